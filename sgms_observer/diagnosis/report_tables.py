"""Tables of a diagnosis's report."""

from __future__ import annotations

import numpy as np

from sgms_observer.diagnosis.answer import Answer
from sgms_observer.diagnosis.diagnosis import Options
from sgms_observer.diagnosis.locate import Located
from sgms_observer.diagnosis.named import NINETY, NOT_DETERMINED, Named
from sgms_observer.effects.catalogue import effect
from sgms_observer.report.page import Table
from sgms_observer.settings.units import Units


def gap_table(answer: Answer) -> Table:
    """Return the table of the three parts of the gap."""
    gap = answer.gap
    closure = "nothing to close" if gap.closure is None else f"{100.0 * gap.closure:.0f} %"
    rows = [
        ("named", f"{gap.named:.3g} %", "closed by the effects and changed values"),
        ("predictable, without a name", f"{gap.predictable:.3g} %", "a free-form regression predicts it"),
        ("not predictable", f"{gap.floor:.3g} %", "noise, encoder, and residual that no recorded signal predicts"),
        ("closure", closure, "(before - after) / (before - not predictable)"),
    ]
    return Table(("part", "size", "meaning"), rows, "Parts of the gap; their squares add up", is_folded=True)


def changed_table(answer: Answer, units: Units) -> list[Table]:
    """Return the table of changed values of the file, if there are any."""
    rows = []
    for item in answer.changed:
        numbers = [value for value in (item.before, item.after) if not isinstance(value, str)]
        factor, unit = prefixed_unit(max(map(abs, numbers), default=0.0), item.unit, units)
        error = f"{factor * item.std_error:.2g}" if item.std_error > 0.0 else "not known"
        values = _number(item.before, factor), _number(item.after, factor)
        rows.append((item.name, *values, error, unit, f"{100.0 * item.closes:.0f} %"))
    header = ("value of the file", "in the file", "in the recordings", "standard error", "unit", "closes together")
    return [Table(header, rows, "Values of the file that moved beyond their tolerance")] if rows else []


def _number(value: float | str, factor: float) -> str:
    """Return a value of the file, times a factor, with four digits."""
    return value if isinstance(value, str) else f"{factor * value:.4g}"


def prefixed_unit(size: float, unit: str, units: Units) -> tuple[float, str]:
    """Return the factor and the unit in which numbers are easy to read.

    Masses, frequencies and phases keep their unit.

    Args:
        size: largest number to be shown, in the unit without a prefix.
        unit: what it has on a prismatic axis.
        units: of the axis.
    """
    if unit in ("", "-", "rad", "kg", "Hz"):
        return 1.0, units.of(unit)
    return units.prefixed(float(f"{size:.3g}"), unit)


def effect_tables(answer: Answer, units: Units) -> list[Table]:
    """Return the table of parameters of each named effect."""
    header = ("parameter", "value", "90 % interval", "unit")
    return [Table(header, _parameter_rows(item, units), item.settings.name) for item in answer.effects]


def _parameter_rows(item: Named, units: Units) -> list[tuple[str, str, str, str]]:
    """Return the table rows of one effect's parameters."""
    entry = effect(item.settings.name)
    rows = []
    for parameter, value, error in zip(entry.parameters, item.settings.values, item.std_error, strict=True):
        if parameter.name in item.undetermined:
            rows.append((parameter.name, NOT_DETERMINED, "-", "-"))
            continue
        factor, unit = prefixed_unit(max(abs(value), error), parameter.unit, units)
        low, high = factor * (value - NINETY * error), factor * (value + NINETY * error)
        interval = f"{low:.4g} .. {high:.4g}" if error > 0.0 else "fixed"
        rows.append((parameter.name, f"{factor * value:.5g}", interval, unit))
    return rows


def test_tables(answer: Answer) -> list[Table]:
    """Return a table of the hypotheses of each round with their tests: value, threshold and outcome."""
    tables = []
    for number, step in enumerate(answer.diagnosis.rounds, 1):
        rows = []
        for item in step.decisions:
            name = item.candidate.name
            if step.accepted is not None and name == step.accepted.candidate.name:
                outcome = "added"
            elif name in step.alternatives:
                outcome = "alternative of the added one"
            else:
                outcome = "not added"
            for test in step.tests_of(item):
                mark = "passed" if test.passed else "failed"
                rows.append((name, outcome, test.name, f"{test.value:.3g}", f"{test.threshold:.3g}", mark))
                name = outcome = ""
        if rows:
            header = ("hypothesis", "outcome", "test", "value", "threshold", "")
            caption = f"Round {number}: hypotheses fitted fully, the best predicting first"
            tables.append(Table(header, rows, caption, is_folded=True))
    whole = [test for test in answer.tests if test.of == "model"]
    if whole:
        listed = [
            (test.name, f"{test.value:.3g}", f"{test.threshold:.3g}", "passed" if test.passed else "failed")
            for test in whole
        ]
        tables.append(Table(("test", "value", "threshold", ""), listed, "Tests of the whole model", is_folded=True))
    return tables


def located_table(answer: Answer, units: Units) -> Table:
    """Return the table of the coordinates that the residual of the refitted file depends on."""
    rows = [
        (
            item.coordinate,
            _range(item, units),
            f"{100 * item.share:.0f} %",
            f"{item.p_value:.3f}",
        )
        for item in answer.located
    ]
    header = ("coordinate", "residual is largest at", "explains of the slow residual", "p-value")
    return Table(header, rows, "Coordinates over which the residual varies by more than chance")


def _range(item: Located, units: Units) -> str:
    """Return where the residual is largest; no range where that is nearly all that was visited."""
    if not item.is_in_a_range:
        return "all over its range"
    factor, unit = prefixed_unit(max(abs(item.low), abs(item.high)), item.unit, units)
    return f"{factor * item.low:.3g} .. {factor * item.high:.3g} {unit}"


def detectable_table(answer: Answer) -> Table:
    """Return the table of the smallest detectable size of each effect."""
    rows = [
        (name, f"{100 * size:.1f} %", effect(name).excitation)
        for name, size in sorted(answer.detectable.items(), key=lambda x: x[1])
    ]
    return Table(("effect", "smallest size seen (share of Coulomb force)", "shown best by"), rows)


def refit_table(answer: Answer, options: Options) -> Table:
    """Return the table of changes of the file's values by the refit within the tolerance."""
    before = answer.diagnosis.written.before
    names = before.model.parameter_names()
    rows = [(name, f"{100 * (np.exp(one) - 1):+.2f} %") for name, one in zip(names, before.logs, strict=True)]
    caption = f"Change of the file's values by the refit within the tolerance of {100 * options.tolerance:.3g} %"
    return Table(("parameter", "change"), rows, caption, is_folded=True)


def screening_table(answer: Answer) -> list[Table]:
    """Return the table of the screening of each effect, if there was one."""
    if not answer.diagnosis.rounds:
        return []
    screenings = sorted(answer.diagnosis.rounds[0].screenings.items(), key=lambda item: -item[1].chi2_reduction)
    rows = [(name, f"{screening.chi2_reduction:.0f}", f"{screening.trials}") for name, screening in screenings]
    caption = "Screening: decrease of the whitened squared residual"
    return [Table(("effect", "chi2_reduction", "shapes tried"), rows, caption, is_folded=True)]
