"""The model of the owner of a stage, and its YAML: four elements, every value wrong by up to five per cent."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.random import Generator
from scipy.optimize import least_squares

from sgms_observer.arrays import Floats
from sim_plant.blind.slots import NOMINAL_RESOLUTION
from sim_plant.blind.stage import PERIOD, TrueStage

ELEMENTS = 4


@dataclass(frozen=True)
class NominalModel:
    """The owner's model, SI units, as it goes into the YAML."""

    model: str
    mass: float
    stiffness: tuple[float, ...]
    fraction: tuple[float, ...]
    viscous: float
    static_force: float
    coulomb_force: float
    knee: float
    attraction: float


def virgin_curve(deflection: Floats, shares: Floats, slip_deflections: Floats) -> Floats:
    """Return the share of the sliding level reached after ``deflection`` [m] from rest."""
    return np.asarray(np.minimum(deflection[:, None] / slip_deflections[None, :], 1.0).dot(shares))


def reduce_contact(shares: Floats, slip_deflections: Floats, count: int = ELEMENTS) -> tuple[Floats, Floats]:
    """Return shares and slip deflections [m] of the ``count`` elements whose virgin curve is closest."""
    grid = np.geomspace(0.3 * slip_deflections.min(), 1.1 * slip_deflections.max(), 200)
    goal = virgin_curve(grid, shares, slip_deflections)

    def unpack(x: Floats) -> tuple[Floats, Floats]:
        weights = np.exp(x[:count] - np.max(x[:count]))
        return weights / weights.sum(), np.exp(x[count:])

    def misfit(x: Floats) -> Floats:
        return virgin_curve(grid, *unpack(x)) - goal

    start = np.concatenate((np.zeros(count), np.log(np.quantile(slip_deflections, (np.arange(count) + 0.5) / count))))
    found = unpack(np.asarray(least_squares(misfit, start).x))
    order = np.argsort(found[1])
    return found[0][order], found[1][order]


def nominal_model(
    stage: TrueStage, rng: Generator, tolerance: float = 0.05, mass_tolerance: float | None = None
) -> NominalModel:
    """Return the model of the owner: the best four elements, each value wrong by up to ``tolerance``.

    Args:
        stage: the truth without anything hidden.
        rng: random numbers.
        tolerance: largest relative error of a friction figure.
        mass_tolerance: largest relative error of the mass; None for the same.
    """
    shares, slip_deflections = reduce_contact(np.array(stage.shares), np.array(stage.slip_deflections))
    mass_share = tolerance if mass_tolerance is None else mass_tolerance

    def off(value: float, largest: float = tolerance) -> float:
        return float(value * (1.0 + largest * rng.uniform(-1.0, 1.0)))

    stiffness = [off(one) for one in shares * stage.coulomb_force / slip_deflections]
    fraction = np.array([off(one) for one in shares])
    coulomb = off(stage.coulomb_force)
    return NominalModel(
        model=stage.model,
        mass=off(stage.mass, mass_share),
        stiffness=tuple(stiffness),
        fraction=tuple(float(one) for one in fraction / fraction.sum()),
        viscous=off(stage.viscous),
        static_force=max(off(stage.static_force), coulomb * 1.001),
        coulomb_force=coulomb,
        knee=off(stage.knee),
        attraction=off(stage.attraction),
    )


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
