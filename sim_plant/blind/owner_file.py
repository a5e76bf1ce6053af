"""The YAML of a stage's owner: the nominal model, and nothing of what is hidden."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from sim_plant.blind.motion import PERIOD
from sim_plant.blind.reduction import NominalModel
from sim_plant.blind.slots import NOMINAL_RESOLUTION


def axis_tree(nominal: NominalModel) -> dict[str, Any]:
    """Return one axis of the YAML."""
    return {
        "mass": nominal.mass,
        "friction": {
            "model": nominal.model,
            "reset": "rate_independent",
            "element_stiffness": list(nominal.stiffness),
            "element_fraction": list(nominal.fraction),
            "element_damping": [0.0] * len(nominal.stiffness),
            "viscous_coefficient": nominal.viscous,
            "static_force": nominal.static_force,
            "coulomb_force": nominal.coulomb_force,
            "stribeck_velocity": nominal.knee,
            "attraction_rate": nominal.attraction,
        },
        "stage": {"encoder": {"resolution": NOMINAL_RESOLUTION}},
        "filter": {"kind": "savgol", "window": 0.011, "degree": 3},
        "estimator": {"correction_every": 2},
    }


def write_owner_file(path: Path, axes: dict[str, NominalModel]) -> None:
    """Write the YAML of the axes by name."""
    tree: dict[str, Any] = {"axes": list(axes), "sample_period": PERIOD}
    tree |= {name: axis_tree(nominal) for name, nominal in axes.items()}
    path.write_text(yaml.safe_dump({"/**": {"ros__parameters": tree}}, sort_keys=False), encoding="utf-8")
