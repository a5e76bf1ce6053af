"""Makes one case: two bags and the owner's file in a folder, the truth sealed outside of it."""

from __future__ import annotations

import hashlib
import secrets
import sys
from dataclasses import dataclass, fields
from importlib import import_module
from pathlib import Path
from typing import Any

from plant_cases import NOTHING, SECOND, SECOND_OUTSIDE, SECOND_SHARE, Case

from sgms_observer.settings.axis import AxisSettings
from sim_plant.blind.case import seal
from sim_plant.plants.effects import KINDS
from sim_plant.plants.machine import draw_plant
from sim_plant.plants.owner import write_yaml
from sim_plant.plants.recording import Recording, record, write_bag

JUDGING_SEED = 500_000
"""Added to the seed of the recording to be judged on: another motion and other noise on the same machine."""


@dataclass(frozen=True)
class Files:
    """Where one case lies: everything but ``truth`` may be seen by the workflow."""

    folder: Path
    bag: Path
    holdout: Path
    config: Path
    result: Path
    truth: Path


def files_of(case: Case, out: Path) -> Files:
    """Return where a case lies; its folder's name does not tell what is hidden.

    Args:
        case: which one.
        out: folder of the benchmark.
    """
    code = hashlib.sha256(f"plants {case.name}".encode()).hexdigest()[:12]
    folder = out / "cases" / code
    truth = out / "truth" / f"{code}.json"
    return Files(folder, folder / "rich", folder / "steps", folder / "axis.yaml", folder / "result", truth)


def make_case(case: Case, out: Path, duration: float, shared: Path | None) -> Files:
    """Write bags, owner's file and sealed truth of a case.

    Args:
        case: which one.
        out: folder of the benchmark.
        duration: of each recording [s].
        shared: folder that holds ``plants/second_plant.py``; needed for the second plant only.
    """
    files = files_of(case, out)
    files.folder.mkdir(parents=True)
    truth = _second(case, files, duration, shared) if case.plant == SECOND else _ours(case, files, duration)
    truth |= {"plant": case.plant, "seed": case.seed, "size": case.size, "salt": secrets.token_hex(16)}
    seal(truth, files.truth, files.folder)
    return files


def _ours(case: Case, files: Files, duration: float) -> dict[str, Any]:
    machine = draw_plant(case.plant, case.seed)
    effects = [] if case.effect == NOTHING else [case.effect]
    learning = record(machine, effects, case.size, case.seed, "rich", duration)
    judging = record(machine, effects, case.size, case.seed + JUDGING_SEED, "steps", duration)
    for path, recording in ((files.bag, learning), (files.holdout, judging)):
        write_bag(path, recording)
    knows_joint_type = "joint_type" in {one.name for one in fields(AxisSettings)}
    write_yaml(files.config, machine, with_joint_type=knows_joint_type)
    return {
        "law": machine.law,
        "effects": effects,
        "is_inside": all(KINDS[one].is_inside for one in effects),
        "is_repeatable": all(KINDS[one].is_repeatable for one in effects),
        "figures": learning.hidden.figures,
        "mass": machine.mass,
        "log_rate": machine.log_rate,
        "hidden_rms": [_hidden_share(one) for one in (learning, judging)],
    }


def _hidden_share(recording: Recording) -> float:
    """Return the rms of the hidden force as a share of the rms effort [-]."""
    return float((recording.hidden_force**2).mean() ** 0.5 / (recording.effort**2).mean() ** 0.5)


def _second(case: Case, files: Files, duration: float, shared: Path | None) -> dict[str, Any]:
    plant, bags = second_modules(shared)
    effects = [] if case.effect == NOTHING else [case.effect]
    strength = case.size / SECOND_SHARE if effects else 1.0
    record_seeds = ((files.bag, "rich"), (files.holdout, "steps"))
    for path, kind in record_seeds:
        one = plant.simulate(effects, strength, case.seed, kind, duration)
        bags.write(path, one)
    bags.nominal_yaml(files.config, one, case.seed)
    figures = {name: _second_figures(name, values) for name, values in one["truth"].items()}
    return {
        "law": "maxwell_slip",
        "effects": effects,
        "is_inside": not set(effects) & set(SECOND_OUTSIDE),
        "is_repeatable": "pulses" not in effects,
        "figures": figures,
        "mass": one["nominal"]["m"],
        "log_rate": 1000.0,
    }


def second_modules(shared: Path | None) -> tuple[Any, Any]:
    """Return the modules of the second plant and of its bags, as they are.

    Args:
        shared: folder that holds ``plants/``.

    Raises:
        FileNotFoundError: when they are not there.
    """
    folder = (shared or Path("../shared")) / "plants"
    if not (folder / "second_plant.py").is_file():
        raise FileNotFoundError(f"{folder} has no second_plant.py; give its parent folder with --shared")
    if str(folder.resolve()) not in sys.path:
        sys.path.append(str(folder.resolve()))
    return import_module("second_plant"), import_module("second_plant_bags")


def _second_figures(name: str, values: list[float]) -> dict[str, float]:
    """Return the true parameters of the second plant under the names that ``sim_plant.plants`` uses; SI units."""
    meaning = {
        "cogging": ("amplitude", "pitch"),
        "asymmetry": ("share",),
        "offset": ("force",),
        "spring": ("stiffness",),
        "mass": ("mass",),
        "quadratic": ("coefficient",),
        "gain": ("gain",),
        "deadzone": ("width",),
        "vibration": ("amplitude", "frequency"),
    }
    figures = dict(zip(meaning.get(name, ()), values, strict=False))
    if name == "delay":
        figures = {"delay": 1.0e-4 * values[0]}
    return figures
