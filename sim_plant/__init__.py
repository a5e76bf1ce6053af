"""Simulated positioning stages: the truth that the observer is tested against and never imports."""
