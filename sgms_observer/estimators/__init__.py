"""Block Z: EKF and moving horizon estimator on one linearised correction interval."""
