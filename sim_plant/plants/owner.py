"""The parameter file of a machine's owner: a four-element Maxwell-slip model of the empty machine, a little off.

The owner has measured how the force rises from rest and how it depends on speed, has fitted four elements and a
Stribeck curve to that, and every figure is off by up to 5 %.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from scipy.optimize import least_squares

from sgms_observer.arrays import Floats
from sim_plant.plants import rate_state
from sim_plant.plants.contact import LAWS, advance, rested_state
from sim_plant.plants.machine import Machine
from sim_plant.plants.stribeck import KNEE, sliding_force

ELEMENTS = 4
OFF = 0.05
"""How far each figure of the owner is off, at most, as a share of it."""


@dataclass(frozen=True)
class NominalModel:
    """What the owner knows.

    Attributes:
        model: ``gms`` or ``sgms``.
        mass: [kg].
        stiffness: of each element [N/m].
        fraction: of each element in the sliding force [-].
        viscous: viscous coefficient [N s/m].
        static_force: [N].
        coulomb_force: [N].
        knee: Stribeck velocity [m/s].
        attraction: attraction rate [N/s].
    """

    model: str
    mass: float
    stiffness: Floats
    fraction: Floats
    viscous: float
    static_force: float
    coulomb_force: float
    knee: float
    attraction: float


def loading_curve(machine: Machine, points: int = 400) -> tuple[Floats, Floats]:
    """Return travel [m] and force [N] of a Maxwell-slip contact at rest that would turn around as this contact does.

    The contact slides one way and turns around, at a hundredth of the Stribeck velocity. By Masing's rule the branch
    after the turn is the loading curve, doubled in both directions.

    Args:
        machine: whose contact.
        points: on the curve.

    Source: Masing 1926, Eigenspannungen und Verfestigung beim Messing, 2nd Int. Congress of Applied Mechanics.
    """
    speed = 0.01 * machine.curve[KNEE]
    number, state, pieces = LAWS.index(machine.law), rested_state(), 20

    def go(travel: float, direction: float) -> float:
        force, duration = 0.0, travel / speed / pieces
        for _ in range(pieces):
            force = advance(number, direction * speed, duration, 1.0, machine.curve, machine.law_parameters, state)
        return force

    for _ in range(100):
        before = go(machine.distance, 1.0)
    travel = np.geomspace(0.01, 60.0, points) * machine.distance
    force = np.array([go(piece, -1.0) for piece in np.diff(travel, prepend=0.0)])
    return 0.5 * travel, 0.5 * (before - force)


def steady_curve(machine: Machine, speed: Floats) -> Floats:
    """Return the force of steady sliding at speeds above zero [m/s], without the viscous part [N]."""
    if machine.law == "rate_state":
        return np.array([rate_state.steady_force(v, machine.curve, machine.law_parameters) for v in speed])
    return np.array([sliding_force(v, machine.curve) for v in speed])


def _fit_elements(travel: Floats, force: Floats) -> tuple[Floats, Floats]:
    """Return slip distances [m] and fractions [-] of the elements whose loading curve is closest."""
    level = force / force.max()
    scale = float(np.interp(0.6, level, travel))

    def parts(x: Floats) -> tuple[Floats, Floats]:
        weight = np.exp(x[ELEMENTS:] - np.max(x[ELEMENTS:]))
        return scale * np.exp(x[:ELEMENTS]), weight / weight.sum()

    def misfit(x: Floats) -> Floats:
        distance, fraction = parts(x)
        return np.asarray(np.minimum(travel[:, None] / distance, 1.0) @ fraction - level)

    start = np.concatenate((np.log([0.3, 1.0, 2.0, 4.0]), np.zeros(ELEMENTS)))
    bounds = (np.repeat([np.log(0.02), -4.0], ELEMENTS), np.repeat([np.log(50.0), 4.0], ELEMENTS))
    return parts(least_squares(misfit, start, bounds=bounds).x)


def _fit_steady(machine: Machine) -> tuple[float, float, float]:
    """Return Coulomb force [N], static force [N] and Stribeck velocity [m/s] of the closest Stribeck curve."""
    speed = np.geomspace(0.05 * machine.curve[KNEE], machine.speed, 60)
    force = steady_curve(machine, speed)

    def misfit(x: Floats) -> Floats:
        return np.asarray(x[0] + (x[1] - x[0]) * np.exp(-((speed / np.exp(x[2])) ** 2)) - force)

    start = np.array([force.min(), force.max(), np.log(machine.curve[KNEE])])
    low, high = 0.5 * force.min(), 2.0 * force.max()
    bounds = ([low, low, start[2] - 3.0], [high, high, start[2] + 3.0])
    found = least_squares(misfit, start, bounds=bounds, x_scale=[force.max(), force.max(), 1.0]).x
    return float(found[0]), float(max(found[1], found[0])), float(np.exp(found[2]))


def nominal_model(machine: Machine, off: float = OFF) -> NominalModel:
    """Return the owner's model, every figure off by up to ``off``."""
    rng = np.random.default_rng([machine.seed, 13])
    distance, fraction = _fit_elements(*loading_curve(machine))
    coulomb, static, knee = _fit_steady(machine)
    stiffness = fraction * static / distance
    wrong = 1.0 + off * rng.uniform(-1.0, 1.0, (ELEMENTS, 2))
    fraction = fraction * wrong[:, 0]
    one, two, three, four, five, six = 1.0 + off * rng.uniform(-1.0, 1.0, 6)
    return NominalModel(
        model=str(rng.choice(["gms", "sgms"])),
        mass=machine.mass * one,
        stiffness=stiffness * wrong[:, 1],
        fraction=fraction / fraction.sum(),
        viscous=machine.viscous * two,
        static_force=max(static * three, coulomb * four),
        coulomb_force=coulomb * four,
        knee=knee * five,
        attraction=static * machine.curve[KNEE] / machine.distance * six,
    )


def _axis_tree(machine: Machine, *, with_joint_type: bool) -> dict[str, Any]:
    """Return one axis of the parameter file, with its joint type where the axis turns and the file shall say so."""
    nominal = nominal_model(machine)
    period = 1.0 / machine.log_rate
    tree: dict[str, Any] = {"joint_type": "revolute"} if with_joint_type and machine.is_rotary else {}
    return tree | {
        "mass": float(nominal.mass),
        "friction": {
            "model": nominal.model,
            "reset": "rate_independent",
            "element_stiffness": [float(one) for one in nominal.stiffness],
            "element_fraction": [float(one) for one in nominal.fraction],
            "element_damping": [0.0] * ELEMENTS,
            "viscous_coefficient": float(nominal.viscous),
            "static_force": float(nominal.static_force),
            "coulomb_force": float(nominal.coulomb_force),
            "stribeck_velocity": float(nominal.knee),
            "attraction_rate": float(nominal.attraction),
        },
        "stage": {
            "encoder": {"resolution": float(machine.resolution)},
            "controller": {"bandwidth": float(machine.bandwidth)},
        },
        "filter": {"window": 11.0 * period, "degree": 3, "effort_is_held": machine.is_held},
        "estimator": {"correction_every": 2},
    }


def write_yaml(path: Path, machine: Machine, *, with_joint_type: bool = True) -> None:
    """Write the owner's parameter file.

    Args:
        path: of the file.
        machine: whose owner.
        with_joint_type: say that the axis turns, where it does; False for a reader that does not know the key.
    """
    axis = _axis_tree(machine, with_joint_type=with_joint_type)
    tree = {"axes": ["x"], "sample_period": 1.0 / machine.log_rate, "x": axis}
    path.write_text(yaml.safe_dump({"/**": {"ros__parameters": tree}}, sort_keys=False), encoding="utf-8")
