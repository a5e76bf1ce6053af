"""The catalogue of effects: what a stage may do beside its friction, each one term written once."""
