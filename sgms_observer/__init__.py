"""Friction observer for positioning stages on the (Smoothed) Generalized Maxwell-Slip model."""

__version__ = "0.1.0"
