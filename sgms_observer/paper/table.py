"""Table II: its twelve cells over noise seeds, other readings of the paper, other stages and other Q."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.paper.conditions import (
    CHOSEN,
    ESTIMATORS,
    LOWPASS,
    LOWPASS_RAW_EFFORT,
    MODELS,
    PAPER,
    PROCESS_STD,
    ROWS,
    Stage,
    Step,
    estimate,
    estimator_friction,
    estimator_settings,
    fewer,
    nrmse,
    simulate,
)
from sgms_observer.settings.axis import FilterSettings, FrictionSettings

PERIOD = 2  # the first one holds the start from rest

Cells = dict[str, dict[str, dict[str, float]]]


@dataclass(frozen=True)
class Reading:
    """One way to read what the paper leaves open.

    Args:
        name: key in ``table2.json``.
        description: one sentence.
        filter: block V, and whether the effort passes the same low-pass.
        is_live: compare the friction as known at each instant; else the MHE's own trajectory (eq. 14).
        stage: mass, controller, noise.
        process_std: Q as a share of nu f_C; None reads the paper's 1e-2 nu as metres.
        gms_modes: the paper's a-priori rules for the GMS model's modes (section III-D3), or ``simulated``, our own.
    """

    name: str
    description: str
    filter: FilterSettings = LOWPASS
    is_live: bool = False
    stage: Stage = CHOSEN
    process_std: float | None = PROCESS_STD
    gms_modes: str = "predicted"


MAIN = Reading("table", "effort through the velocity's low-pass, MHE: its trajectory over the last interval, EKF: live")
LIVE = Reading("live", "the same, every estimate as known at its own instant", is_live=True)
RAW = Reading(
    "raw_effort", "effort unfiltered and so ahead of the acceleration, live", filter=LOWPASS_RAW_EFFORT, is_live=True
)
RAW_QUIET = Reading(
    "raw_effort_no_noise", "the same without noise, 0.3 kg and 370 Hz", filter=LOWPASS_RAW_EFFORT, is_live=True,
    stage=Stage(mass=0.3, bandwidth=370.0, noise=0.0),
)  # fmt: skip
METRES = Reading("q_in_metres", "the table with Q = (1e-2 nu)^2 read in square metres", process_std=None)
EXACT = replace(
    MAIN, name="gms_exact", description="the table, GMS with events inside a step and modes anew in each iteration",
    gms_modes="simulated",
)  # fmt: skip
READINGS = (MAIN, LIVE, RAW, RAW_QUIET, METRES, EXACT)


def stage_readings() -> list[Reading]:
    """Return the main reading on other stages, for the table of dependence."""
    return [
        replace(MAIN, name=f"{mass:g} kg, {bandwidth:g} Hz", stage=Stage(mass=mass, bandwidth=bandwidth))
        for mass in (1.0, 3.0, 10.0, 20.0)
        for bandwidth in (30.0, 100.0, 300.0)
    ]


def process_readings() -> list[Reading]:
    """Return the main reading with other Q, for the table of dependence."""
    return [replace(MAIN, name=f"Q = ({share:g} nu f_C)^2", process_std=share) for share in (0.03, 0.05, 0.1, 0.2, 0.4)]


def literal_process(friction: FrictionSettings) -> Floats:
    """Return Q in force units when the paper's 1e-2 nu are metres [N^2]."""
    stiffness, fraction = np.array(friction.element_stiffness), np.array(friction.element_fraction)
    product: Floats = 1.0e-2 * fraction * stiffness
    return product**2


def cells_of(
    reading: Reading, seeds: Iterable[int], step: Step = lambda: None
) -> dict[str, dict[str, dict[str, list[float]]]]:
    """Return the NRMSE [%] of the twelve cells, one value per seed."""
    records = [simulate(reading.stage, PERIOD, seed) for seed in seeds]
    cells: dict[str, dict[str, dict[str, list[float]]]] = {}
    for row, factor in ROWS.items():
        cells[row] = {}
        for model in MODELS:
            friction = estimator_friction(model, factor)
            process = literal_process(friction) if reading.process_std is None else None
            cells[row][model] = {}
            for name in ESTIMATORS:
                settings = estimator_settings(name, reading.process_std or PROCESS_STD, reading.gms_modes)
                values = []
                for record in records:
                    result = estimate(
                        record, reading.filter, settings, friction, reading.stage.mass, factor,
                        with_trajectory=not reading.is_live, process=process,
                    )  # fmt: skip
                    values.append(nrmse(record, result.live if reading.is_live else result.trajectory, PERIOD))
                    step()
                cells[row][model][name] = values
    return cells


def reduce_cells(cells: dict[str, dict[str, dict[str, list[float]]]], function: Callable[[Any], Any]) -> Cells:
    """Apply ``function`` to every cell's list of values."""
    return {
        row: {m: {e: float(function(v)) for e, v in by_estimator.items()} for m, by_estimator in by_model.items()}
        for row, by_model in cells.items()
    }


def runs_of_table(seeds: int) -> int:
    """Return how many runs of an estimator ``table_two`` makes."""
    cells = len(ROWS) * len(MODELS) * len(ESTIMATORS)
    others = len(stage_readings()) + len(process_readings())
    return cells * (len(READINGS) * seeds + others * fewer(seeds))


def table_two(seeds: int, step: Step = lambda: None) -> dict[str, Any]:
    """Compute Table II and everything beside it.

    Args:
        seeds: how many noise seeds for the readings; a quarter of them for the dependence.
        step: called after every run of an estimator.

    Returns:
        What ``table2.json`` holds.
    """
    numbers = range(1, seeds + 1)
    few = range(1, fewer(seeds) + 1)
    result: dict[str, Any] = {}
    for reading in READINGS:
        cells = cells_of(reading, numbers, step)
        if reading is MAIN:
            result.update(reduce_cells(cells, np.mean))
            result["standard_deviation"] = reduce_cells(cells, np.std)
            result["paper"] = PAPER
            result["readings"] = {}
        if reading is EXACT:
            mean, spread = reduce_cells(cells, np.mean), reduce_cells(cells, np.std)
            result["gms_exact"] = {row: mean[row]["gms"] for row in ROWS}
            result["gms_exact_standard_deviation"] = {row: spread[row]["gms"] for row in ROWS}
        result["readings"][reading.name] = {
            "description": reading.description,
            "stage": vars(reading.stage),
            "mean": reduce_cells(cells, np.mean),
            "standard_deviation": reduce_cells(cells, np.std),
        }
    result["dependence"] = {"stage": {}, "process": {}}
    for kind, readings in (("stage", stage_readings()), ("process", process_readings())):
        for reading in readings:
            result["dependence"][kind][reading.name] = reduce_cells(cells_of(reading, few, step), np.mean)
    result["conditions"] = {
        "seeds": list(numbers),
        "seeds_of_dependence": list(few),
        "period": PERIOD,
        "unit": "% of the range of the friction",
        **vars(CHOSEN),
        "process_std": PROCESS_STD,
        "description": MAIN.description,
    }
    return result


def table_markdown(result: dict[str, Any]) -> str:
    """Return ``table2.md`` for the result of ``table_two``."""
    conditions = result["conditions"]
    lines = [
        "# Table II",
        "",
        f"NRMSE [%] over period {PERIOD} of the sine, mean ± standard deviation over {len(conditions['seeds'])} noise"
        f" seeds; in brackets the paper's figure. Stage: {conditions['mass']:g} kg, {conditions['bandwidth']:g} Hz,"
        f" {conditions['noise']:g} N noise on every effort sample. Reading: {MAIN.description}.",
        "",
        "| kappa | model | EKF(z) | MHE(z) | MHE(z,p) |",
        "|---|---|---|---|---|",
    ]
    for row in ROWS:
        for model in MODELS:
            mean, spread = result[row][model], result["standard_deviation"][row][model]
            entries = [f"{mean[e]:.2f} ± {spread[e]:.2f} ({PAPER[row][model][e]:.2f})" for e in ESTIMATORS]
            lines.append(f"| {_row_name(row)} | {_model_name(model)} | " + " | ".join(entries) + " |")
        mean, spread = result["gms_exact"][row], result["gms_exact_standard_deviation"][row]
        entries = [f"{mean[e]:.2f} ± {spread[e]:.2f}" for e in ESTIMATORS]
        lines.append(f"| {_row_name(row)} | GMS, our own modes | " + " | ".join(entries) + " |")
    lines += ["", "## Other readings of the paper", "", _wide_head("reading")]
    for reading in READINGS:
        lines.append(_wide_row(f"{reading.name}: {reading.description}", result["readings"][reading.name]["mean"]))
    lines += [_wide_row("the paper", PAPER)]
    for kind, title in (("stage", "Mass and controller"), ("process", "Process noise")):
        lines += ["", f"## {title}", "", _wide_head("choice")]
        lines += [_wide_row(name, cells) for name, cells in result["dependence"][kind].items()]
    return "\n".join(lines) + "\n"


def _row_name(row: str) -> str:
    return {"minus20": "-20 %", "plus20": "+20 %"}[row]


def _model_name(model: str) -> str:
    return {"gms": "GMS", "sgms": "S-GMS"}[model]


def _wide_head(first: str) -> str:
    groups = [f"{_row_name(row)} {_model_name(model)}" for row in ROWS for model in MODELS]
    names = " | ".join(f"{group}: EKF, MHE(z), MHE(z,p)" for group in groups)
    return f"| {first} | {names} |\n|---|" + "---|" * len(groups)


def _wide_row(name: str, cells: Cells) -> str:
    groups = [", ".join(f"{cells[row][model][e]:.2f}" for e in ESTIMATORS) for row in ROWS for model in MODELS]
    return f"| {name} | " + " | ".join(groups) + " |"
