"""The picture of the gap: what each model leaves of the effort, down to what no recorded signal predicts."""

from __future__ import annotations

from collections.abc import Sequence

from sgms_observer.report.drawing import ESTIMATE, MEASURED, sheet
from sgms_observer.report.page import Picture


def gap_picture(steps: Sequence[tuple[str, float]], floor: float) -> Picture:
    """Draw a bar for the gap of each model, one below the other, and a line at the floor.

    Args:
        steps: name of each model and its gap [% of the rms effort], the first one above.
        floor: residual that no recorded signal predicts [% of the rms effort].
    """
    caption = "Gap after each step, down to the residual that no recorded signal predicts."
    with sheet("gap", caption, height=0.8 + 0.32 * len(steps)) as drawn:
        axes = drawn.axes[0]
        names, sizes = [name for name, _ in steps][::-1], [size for _, size in steps][::-1]
        bars = axes.barh(names, sizes, color=MEASURED, height=0.62, label="gap")
        axes.bar_label(bars, labels=[f"{size:.3g} %" for size in sizes], padding=3, fontsize=9.0)
        axes.axvline(floor, color=ESTIMATE, lw=1.6, ls="--", label=f"not predictable, {floor:.3g} %")
        axes.set_xlim(0.0, 1.18 * max(*sizes, floor, 1e-12))
        axes.set_xlabel("gap [% of rms effort]")
        axes.grid(visible=False, axis="y")
    return drawn.picture
