"""The report of ``sgms paper``: Table II beside the paper's, what is reached beyond it, and the figures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sgms_observer.paper.conditions import ESTIMATORS, MODELS, PAPER, ROWS
from sgms_observer.paper.table import READINGS
from sgms_observer.report.drawing import ESTIMATE, MEASURED, sheet
from sgms_observer.report.page import BAD, GOOD, UNSURE, Light, Page, Picture, Plot, Section, Table

_ROWS = {"minus20": "kappa -20 %", "plus20": "kappa +20 %"}
_MODELS = {"gms": "GMS", "sgms": "S-GMS"}
_COLUMNS = {"ekf_z": "EKF(z)", "mhe_z": "MHE(z)", "mhe_zp": "MHE(z,p)"}
_TABLE, _BEYOND, _CONSISTENCY = "Table II", "Beyond the paper", "Consistency"


def paper_page(
    table: dict[str, Any], beyond: dict[str, Any], figures: Sequence[Picture], plots: Sequence[Plot] = ()
) -> Page:
    """Return the report.

    Args:
        table: what table2.json holds.
        beyond: what beyond.json holds.
        figures: of the paper.
        plots: the estimates over time.
    """
    best = max(beyond[row]["nrmse"] for row in ROWS)
    least = min(PAPER[row][model][name] for row in ROWS for model in MODELS for name in ESTIMATORS)
    verdict = (
        f"On the paper's simulation the best configuration estimates friction to {best:.2g} % of its range, live; the"
        f" best cell of the paper's Table II is {least:.2g} %."
    )
    conditions = table["conditions"]
    seeds = f"{len(conditions['seeds'])} noise seeds"
    text = (
        f"NRMSE in % of the friction's range, mean and standard deviation over {seeds}, over period"
        f" {conditions['period']} of the sine. Stage: {conditions['mass']:g} kg, {conditions['bandwidth']:g} Hz,"
        f" {conditions['noise']:g} N noise. Reading of the paper: {conditions['description']}."
    )
    beyond_text = (
        f"NRMSE in % of the friction's range over period {beyond['conditions']['period']}, every estimate live at its"
        " own instant, from position and effort only."
    )
    over_time = f"One noise seed, the estimators of Figures 6 and 7. Table II counts period {conditions['period']}."
    return Page(
        "The paper's simulation again",
        verdict,
        [
            Section("Table II", [text], [_table(table), *_readings(table)], [_bars(table)]),
            Section("Beyond Table II", [beyond_text], [*_beyond(beyond)]),
            *([Section("Estimates over time", [over_time], plots=plots)] if plots else []),
            Section("Figures of the paper", pictures=figures),
        ],
        f"From {seeds}, simulated.",
        lights=[*_about_table(table), _about_best(beyond, least), _about_kappa(beyond), *_about_consistency(beyond)],
    )


def _cell(row: str, model: str, name: str) -> str:
    """Return the name of a cell of Table II."""
    return f"{_COLUMNS[name]} of {_MODELS[model]} at {_ROWS[row]}"


def _about_table(table: dict[str, Any]) -> list[Light]:
    """Ask how the cells compare with the paper's."""
    cells = [(row, model, name) for row in ROWS for model in MODELS for name in ESTIMATORS]
    above = [(r, m, n) for r, m, n in cells if table[r][m][n] > PAPER[r][m][n]]
    listed = "; ".join(f"{_cell(*cell)}: {table[cell[0]][cell[1]][cell[2]]:.2f} %" for cell in above)
    facts = f"{len(cells) - len(above)} of {len(cells)} cells are.{f' Above: {listed}.' if above else ''}"
    state = GOOD if not above else UNSURE if len(above) < len(cells) else BAD
    pairs = [(table[row]["sgms"]["mhe_zp"], table[row]["gms"]["mhe_zp"]) for row in ROWS]
    numbers = " and ".join(
        f"{smooth:.2f} against {other:.2f} % at {_ROWS[row]}" for row, (smooth, other) in zip(ROWS, pairs, strict=True)
    )
    is_better = [smooth < other for smooth, other in pairs]
    finding = GOOD if all(is_better) else UNSURE if any(is_better) else BAD
    return [
        Light(_TABLE, "Is the error of every cell at or below the paper's?", state, facts),
        Light(_TABLE, "Is S-GMS better than GMS inside the MHE that estimates kappa?", finding, f"{numbers}."),
    ]


def _about_best(beyond: dict[str, Any], least: float) -> Light:
    """Ask whether the best configuration is better than every cell of the paper."""
    errors = [beyond[row]["nrmse"] for row in ROWS]
    facts = f"{' and '.join(f'{error:.3f}' for error in errors)} %, every cell of the paper is {least:.2f} % or more."
    return Light(
        _BEYOND, "Is the best configuration better than the paper's best?", GOOD if max(errors) < least else BAD, facts
    )


def _about_kappa(beyond: dict[str, Any]) -> Light:
    """Ask whether the stiffness, 20 % off at the start, is found."""
    off = [abs(beyond[row]["kappa_over_truth_after_ten_periods"] - 1.0) for row in ROWS]
    start = 0.2
    facts = f"It is {' and '.join(f'{100 * one:.1f}' for one in off)} % off after ten periods, 20 % at the start."
    state = GOOD if max(off) < 0.5 * start else UNSURE if max(off) < start else BAD
    return Light(_BEYOND, "Is the stiffness kappa found?", state, facts)


def _about_consistency(beyond: dict[str, Any]) -> list[Light]:
    """Ask whether the estimator knows its own error."""
    found = beyond["consistency"]
    lower, upper = found["bounds"]
    lights = []
    for row in ROWS:
        mean, covered = found[row]["nis_mean"], found[row]["band_coverage"]
        facts = (
            f"Mean NIS {mean:.3f} (95 % bounds {lower:.2f} to {upper:.2f}); the 95 % band covers the truth"
            f" {100 * covered:.1f} % of the time."
        )
        question = f"Does the estimator know its own error at {_ROWS[row]}?"
        lights.append(Light(_CONSISTENCY, question, GOOD if lower <= mean <= upper else UNSURE, facts))
    return lights


def _bars(table: dict[str, Any]) -> Picture:
    """Draw every cell beside the paper's."""
    cells = [(row, model, name) for row in ROWS for model in MODELS for name in ESTIMATORS][::-1]
    with sheet("table2", "Cells of Table II beside the paper's.", height=4.6) as drawn:
        axes = drawn.axes[0]
        for shift, values, colour, label in (
            (0.2, table, MEASURED, "this package"), (-0.2, PAPER, ESTIMATE, "the paper")
        ):  # fmt: skip
            sizes = [values[row][model][name] for row, model, name in cells]
            axes.barh([number + shift for number in range(len(cells))], sizes, 0.38, color=colour, label=label)
        names = [f"{_ROWS[row][6:]}, {_MODELS[model]}, {_COLUMNS[name]}" for row, model, name in cells]
        axes.set_yticks(range(len(cells)), names)
        axes.set_xlabel("NRMSE [% of the friction's range]")
        axes.grid(visible=False, axis="y")
    return drawn.picture


def _table(table: dict[str, Any]) -> Table:
    """Return Table II."""
    rows = []
    for row in ROWS:
        for model in MODELS:
            mean, deviation = table[row][model], table["standard_deviation"][row][model]
            entries = [f"{mean[e]:.2f} +- {deviation[e]:.2f} ({PAPER[row][model][e]:.2f})" for e in ESTIMATORS]
            rows.append((f"{_ROWS[row]}, {_MODELS[model]}", *entries))
    return Table(("model", *_COLUMNS.values()), rows, "NRMSE [%], in brackets the paper's")


def _readings(table: dict[str, Any]) -> list[Table]:
    """Return the other readings of the paper, and other stages and process noises, folded."""
    header = ("choice", *(f"{_ROWS[row]}, {_MODELS[model]}" for row in ROWS for model in MODELS))

    def cells(of: dict[str, Any]) -> list[str]:
        return [", ".join(f"{of[row][model][e]:.2f}" for e in ESTIMATORS) for row in ROWS for model in MODELS]

    means = [(f"{one.name}: {one.description}", *cells(table["readings"][one.name]["mean"])) for one in READINGS]
    order = "EKF(z), MHE(z), MHE(z,p)"
    tables = [Table(header, means, f"Other readings of the paper: {order}", is_folded=True)]
    for kind, title in (("stage", "Mass and controller"), ("process", "Process noise")):
        rows = [(name, *cells(of)) for name, of in table["dependence"][kind].items()]
        tables.append(Table(header, rows, f"{title}: {order}", is_folded=True))
    return tables


def _beyond(beyond: dict[str, Any]) -> list[Table]:
    """Return what each step towards the best configuration gave, and what it loses without each."""
    header = ("configuration", *(f"{_ROWS[row]}: NRMSE [%] (kappa over truth)" for row in ROWS))

    def row_of(name: str, scores: dict[str, Any]) -> tuple[str, ...]:
        entries = (f"{scores[r]['nrmse']:.3f} ({scores[r]['kappa_over_truth_after_ten_periods']:.3f})" for r in ROWS)
        return name, *entries

    ladder = [row_of("best", beyond), *(row_of(name, one) for name, one in beyond["ladder"].items())]
    without = [row_of(f"without {name}", one) for name, one in beyond["best_without"].items()]
    return [
        Table(header, ladder, "The best configuration, and the steps that lead from the paper's to it"),
        Table(header, without, "The best configuration without each of its parts", is_folded=True),
    ]
