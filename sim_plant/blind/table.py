"""What a whole blind set says: figures with their confidence intervals, a table per effect, the confusion matrix."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import sqrt
from pathlib import Path
from statistics import fmean, median

import numpy as np

from sgms_observer.arrays import Ints
from sim_plant.blind.menu import INSIDE, OUTSIDE
from sim_plant.blind.score import NAMING, CaseScore

SMALL = 0.075
"""Effects below this share of the Coulomb force are the small ones (5 %), above it the large ones (10-25 %)."""
TWO_SIDED_95 = 1.959963984540054
VERDICT_COLUMNS = ("no_effect", "unknown_effect", "cannot_tell")


@dataclass(frozen=True)
class Share:
    """A counted share with its Wilson interval.

    Attributes:
        hits: how many.
        total: out of how many.
    """

    hits: int
    total: int

    @property
    def value(self) -> float:
        """Return the share; NaN out of none."""
        return self.hits / self.total if self.total else float("nan")

    @property
    def bounds(self) -> tuple[float, float]:
        """Return the 95 % interval of Wilson (1927)."""
        if not self.total:
            return 0.0, 1.0
        z2 = TWO_SIDED_95**2
        middle = (self.hits + 0.5 * z2) / (self.total + z2)
        half = TWO_SIDED_95 / (self.total + z2) * sqrt(self.hits * (self.total - self.hits) / self.total + 0.25 * z2)
        return max(0.0, middle - half), min(1.0, middle + half)

    def __str__(self) -> str:
        """Return ``96.0 % (95/99, 90.0-98.4)``."""
        if not self.total:
            return "no case"
        low, high = self.bounds
        return f"{100 * self.value:.1f} % ({self.hits}/{self.total}, {100 * low:.1f}-{100 * high:.1f})"


def count(flags: list[bool]) -> Share:
    """Return the share of true flags."""
    return Share(sum(flags), len(flags))


@dataclass(frozen=True)
class Figure:
    """One line of the table: name, value as text, what it has to reach, and whether it does (None: no case)."""

    name: str
    value: str
    target: str
    is_reached: bool | None


def _at_least(name: str, share: Share, target: float) -> Figure:
    return Figure(name, str(share), f">= {100 * target:g} %", share.value >= target if share.total else None)


def _at_most(name: str, share: Share, target: float) -> Figure:
    return Figure(name, str(share), f"<= {100 * target:g} %", share.value <= target if share.total else None)


def _measured(
    name: str,
    values: Sequence[float],
    reduce: Callable[[Sequence[float]], float],
    form: str,
    target: str,
    is_reached: Callable[[float], bool],
) -> Figure:
    if not values:
        return Figure(name, "no case", target, None)
    value = reduce(values)
    return Figure(name, f"{form.format(value)} ({len(values)} values)", target, is_reached(value))


def lower_tenth(values: Sequence[float]) -> float:
    """Return the value that a tenth of ``values`` do not exceed (the worst tenth's best)."""
    ordered = sorted(values)
    return ordered[max(0, int(0.1 * len(ordered) + 0.5) - 1)]


def figures(scores: Sequence[CaseScore]) -> list[Figure]:
    """Return the figures to reach, in the order in which they were asked for."""
    null = [one for one in scores if not one.effects]
    single = [one for one in scores if len(one.effects) == 1 and one.is_inside]
    outside = [one for one in scores if one.effects and not one.is_inside]
    double = [one for one in scores if len(one.effects) > 1 and one.is_inside]
    large = [one for one in single if one.size > SMALL]
    small = [one for one in single if one.size <= SMALL]
    named = [one for one in single if one.verdict in NAMING]
    sizes = [float(len(one.first_set)) for one in named]
    closures = [one.closure for one in (*single, *double) if one.closure is not None and one.verdict in NAMING]
    errors = [one.error for case in scores for one in case.parameters]
    covered = [one.is_covered for case in scores for one in case.parameters if one.is_covered is not None]
    seconds = [one.seconds for one in scores if one.seconds is not None]
    worse = [float(one.is_worse) for one in scores]
    cover = count(covered)
    lines = [
        _at_most("false alarms, nothing hidden", count([one.is_alarm for one in null]), 0.02),
        _at_least("right name first, 10-25 %", count([one.first == one.effects[0] for one in large]), 0.95),
        _at_least("right name first, 5 %", count([one.first == one.effects[0] for one in small]), 0.80),
        _at_least("truth inside the reported set", count([one.effects[0] in one.reported for one in named]), 0.98),
        _measured("mean set size", sizes, fmean, "{:.2f}", "<= 1.5", lambda value: value <= 1.5),
        _at_most("confidently wrong name, over all", count([one.is_confidently_wrong for one in scores]), 0.02),
        _at_least(
            "outside the catalogue, reported as unknown", count([is_reported_unknown(one) for one in outside]), 0.90
        ),
        _at_least("two effects: both", count([set(one.effects) <= set(one.named) for one in double]), 0.80),
        _at_least(
            "two effects: at least one", count([bool(set(one.effects) & set(one.named)) for one in double]), 0.98
        ),
        _measured("closure on held-out, median", closures, median, "{:.3f}", ">= 0.95", lambda value: value >= 0.95),
        _measured("closure, worst tenth", closures, lower_tenth, "{:.3f}", ">= 0.8", lambda value: value >= 0.8),
        _measured("held-out gap made worse, cases", worse, sum, "{:.0f}", "0", lambda value: value == 0.0),
        _measured("parameter error, median", errors, median, "{:.2%}", "<= 5 %", lambda value: value <= 0.05),
        Figure("90 % intervals cover", str(cover), "85-95 %", 0.85 <= cover.value <= 0.95 if cover.total else None),
        _measured(
            "computing time for a 60 s record, one core, longest",
            seconds,
            max,
            "{:.0f} s",
            "<= 120 s",
            lambda value: value <= 120.0,
        ),
    ]
    return lines


def is_reported_unknown(score: CaseScore) -> bool:
    """Return whether the verdict is an unknown effect."""
    return score.verdict == "unknown_effect"


def table_text(lines: Sequence[Figure]) -> str:
    """Return the figures as a Markdown table."""
    word = {True: "yes", False: "**no**", None: "-"}
    rows = [f"| {one.name} | {one.value} | {one.target} | {word[one.is_reached]} |" for one in lines]
    return "\n".join(["| figure | value (95 % interval) | target | reached |", "|---|---|---|---|", *rows])


def per_effect_text(scores: Sequence[CaseScore]) -> str:
    """Return a Markdown table of every hidden effect and size: right first, in the set, verdicts, closure."""
    groups: dict[tuple[str, str], list[CaseScore]] = {}
    for one in scores:
        size = "5 %" if one.size <= SMALL else "10-25 %"
        key = ("+".join(one.effects), size) if one.effects else ("nothing", "-")
        groups.setdefault(key, []).append(one)
    rows = [
        "| hidden | size | cases | right first | in the set | reported first instead | closure (median) |",
        "|---|---|---|---|---|---|---|",
    ]
    for (name, size), group in sorted(groups.items()):
        closures = [one.closure for one in group if one.closure is not None]
        wrong: dict[str, int] = {}
        for one in group:
            if one.first not in one.effects:
                wrong[one.first] = wrong.get(one.first, 0) + 1
        others = ", ".join(f"{word} {number}" for word, number in sorted(wrong.items(), key=lambda item: -item[1]))
        right = sum(one.first in one.effects for one in group)
        inside = sum(bool(set(one.effects) & one.reported) for one in group)
        closed = f"{median(closures):.2f}" if closures else "-"
        rows.append(f"| {name} | {size} | {len(group)} | {right} | {inside} | {others} | {closed} |")
    return "\n".join(rows)


def matrix(scores: Sequence[CaseScore]) -> tuple[list[str], list[str], Ints]:
    """Return rows (hidden), columns (reported first) and counts; cases with two effects are left out."""
    single = [one for one in scores if len(one.effects) < 2]
    present = {one.effects[0] if one.effects else "nothing" for one in single}
    rows = [name for name in (*INSIDE, *OUTSIDE, "nothing") if name in present]
    answers = {one.first for one in single}
    columns = [name for name in INSIDE if name in present or name in answers]
    columns += sorted(answers - set(columns) - set(VERDICT_COLUMNS)) + list(VERDICT_COLUMNS)
    counts = np.zeros((len(rows), len(columns)), dtype=np.int64)
    for one in single:
        counts[rows.index(one.effects[0] if one.effects else "nothing"), columns.index(one.first)] += 1
    return rows, columns, counts


def confusion_text(scores: Sequence[CaseScore]) -> str:
    """Return the matrix as text: columns are numbered, a dot stands for none."""
    rows, columns, counts = matrix(scores)
    width = max((len(name) for name in rows), default=7)
    lines = [" " * width + "".join(f"{i + 1:4d}" for i in range(len(columns)))]
    for name, row in zip(rows, counts, strict=True):
        lines.append(f"{name:<{width}}" + "".join(f"{value:4d}" if value else "   ." for value in row))
    lines += [f"{i + 1:4d} {name}" for i, name in enumerate(columns)]
    return "\n".join(lines)


def confusion_picture(scores: Sequence[CaseScore], path: Path) -> None:
    """Draw the matrix into a PNG; each row is coloured by its shares."""
    from matplotlib.figure import Figure

    rows, columns, counts = matrix(scores)
    figure = Figure(figsize=(0.32 * len(columns) + 3.5, 0.26 * len(rows) + 3.2), layout="constrained")
    axes = figure.add_subplot()
    axes.imshow(counts / np.maximum(counts.sum(axis=1, keepdims=True), 1), cmap="Blues", vmin=0.0, vmax=1.0)
    axes.set_xticks(range(len(columns)), columns, rotation=90, fontsize=7)
    axes.set_yticks(range(len(rows)), rows, fontsize=7)
    for i, j in zip(*np.nonzero(counts), strict=True):
        share = counts[i, j] / counts[i].sum()
        colour = "white" if share > 0.5 else "black"
        axes.text(j, i, str(counts[i, j]), ha="center", va="center", fontsize=6, color=colour)
    axes.set_xlabel("reported first")
    axes.set_ylabel("hidden")
    figure.savefig(path, dpi=130)
