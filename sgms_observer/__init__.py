"""Friction observer for positioning stages on the (Smoothed) Generalized Maxwell-Slip model.

What a user of Python needs can be imported from here; each name is loaded when it is first asked for.
"""

from __future__ import annotations

import importlib
from typing import Any

__version__ = "0.1.0"

_PUBLIC = {
    "settings.load": ("load_settings", "settings_from_tree"),
    "settings.write": ("write_settings",),
    "settings.axis": ("AxisSettings", "FrictionSettings", "Settings"),
    "observer.samples": ("Estimates", "Samples"),
    "observer.axis_observer": ("AxisObserver",),
    "observer.all_axes": ("AllAxes",),
    "effects.effect": ("Effect", "EffectParameter", "EffectSettings", "Place"),
    "bags.reader": ("read_samples",),
    "bags.writer": ("BagWriter",),
    "offline.recording": ("Recording", "read_recordings", "recordings_from_samples"),
    "identification.identify": ("IdentifyOptions", "identify"),
    "application.diagnose": ("DiagnoseRequest", "diagnose_bags"),
    "application.replay": ("replay_bag",),
    "excitation.limits": ("ExcitationLimits",),
    "excitation.reference": ("design_excitation",),
    "status": ("Status",),
    "errors": ("ConfigurationError", "DataError", "RecordingError", "SgmsError"),
}
_MODULES = {name: f"{__name__}.{module}" for module, names in _PUBLIC.items() for name in names}

__all__ = ["__version__", *_MODULES]


def __getattr__(name: str) -> Any:
    """Load a public name."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__} has no attribute {name}")
    return getattr(importlib.import_module(_MODULES[name]), name)


def __dir__() -> list[str]:
    """Return the public names."""
    return sorted(__all__)
