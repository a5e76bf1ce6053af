"""The confusion matrix: what was hidden against what was said first, as text and as a picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sim_plant.blind.menu import INSIDE, OUTSIDE
from sim_plant.blind.score import CaseScore

VERDICT_COLUMNS = ("no_effect", "unknown_effect", "cannot_tell")


def matrix(scores: Sequence[CaseScore]) -> tuple[list[str], list[str], NDArray[np.int64]]:
    """Return rows (hidden), columns (said first) and counts; cases with two effects are left out.

    Args:
        scores: all cases of a set.
    """
    kept = [one for one in scores if len(one.effects) < 2]
    present = {one.effects[0] if one.effects else "nothing" for one in kept}
    rows = [name for name in (*INSIDE, *OUTSIDE, "nothing") if name in present]
    said = {one.first for one in kept}
    columns = [name for name in INSIDE if name in present or name in said]
    columns += sorted(said - set(columns) - set(VERDICT_COLUMNS)) + list(VERDICT_COLUMNS)
    counts = np.zeros((len(rows), len(columns)), dtype=np.int64)
    for one in kept:
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
    """Draw the matrix; each row is coloured by its shares.

    Args:
        scores: all cases of a set.
        path: PNG to write.
    """
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
    axes.set_xlabel("said first")
    axes.set_ylabel("hidden")
    figure.savefig(path, dpi=130)
