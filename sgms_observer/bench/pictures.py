"""Pictures of the timings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from sgms_observer.whole_file import write_figure


def draw(result: Mapping[str, Any], folder: Path) -> list[Path]:
    """Draw the growth and, if they were timed, the peers.

    Args:
        result: what the JSON file holds.
        folder: where to.

    Returns:
        The pictures.
    """
    import matplotlib

    matplotlib.use("Agg")
    folder.mkdir(parents=True, exist_ok=True)
    drawn = []
    if result["growth"]["n_z"]:
        drawn.append(_growth(result["growth"], folder / "growth.png"))
    if result["mhe_rti_us"]:
        drawn.append(_peers(result, folder / "peers.png"))
    return drawn


def _growth(growth: Mapping[str, Any], path: Path) -> Path:
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(1, 2, figsize=(9.0, 3.6), sharey=True, layout="constrained")
    for axis, (name, label) in zip(axes, (("n_z", "elements n_z"), ("horizon", "horizon N")), strict=True):
        sizes, times = zip(*growth[name], strict=True)
        axis.loglog(sizes, times, "o-", label="one iteration")
        axis.loglog(sizes, [times[-1] * size / sizes[-1] for size in sizes], ":", color="grey", label="linear")
        axis.set_xticks(sizes, [f"{size:g}" for size in sizes])
        axis.set_xticks([], minor=True)
        axis.set_xlabel(label)
        axis.set_title(f"slope {growth['slope'][name]:.2f}", fontsize=10)
        axis.grid(True, which="both", alpha=0.3)
    axes[0].set_ylabel("time [us]")
    axes[0].legend()
    write_figure(figure, path, 120)
    pyplot.close(figure)
    return path


def _peers(result: Mapping[str, Any], path: Path) -> Path:
    from matplotlib import pyplot

    rows: list[tuple[str, Mapping[str, float]]] = [
        ("EKF prediction", result["ekf_predict_us"]),
        ("one real-time iteration", result["mhe_rti_us"]),
        ("... with arrival cost", result["mhe_rti_with_arrival_us"]),
    ]
    names: Sequence[tuple[str, str]] = (
        ("casadi_sqpmethod", "CasADi sqpmethod, one iteration"),
        ("casadi_ipopt", "CasADi ipopt, converged"),
        ("do_mpc", "do-mpc MHE"),
    )
    rows += [(label, result["peers_us"][name]) for name, label in names if result["peers_us"].get(name)]
    figure, axis = pyplot.subplots(figsize=(9.0, 3.2), layout="constrained")
    places = range(len(rows) - 1, -1, -1)
    axis.barh(
        list(places),
        [row["median"] for _, row in rows],
        log=True,
        height=0.9,
        color=["C0"] * 3 + ["C7"] * (len(rows) - 3),
    )
    axis.plot([row["p99"] for _, row in rows], list(places), "k|", markersize=12, label="99th percentile")
    for place, (_, row) in zip(places, rows, strict=True):
        text = f"{row['median']:.3g}" if row["median"] < 100.0 else f"{row['median']:,.0f}"
        axis.annotate(
            text, (row["median"], place), (-4, 0), textcoords="offset points", va="center", ha="right", fontsize=8,
            color="white",
        )  # fmt: skip
    axis.set_xlim(left=0.1)
    axis.set_yticks(list(places), [label for label, _ in rows])
    axis.set_xlabel("median time of one call from Python [us]")
    axis.legend(loc="upper right")
    write_figure(figure, path, 120)
    pyplot.close(figure)
    return path
