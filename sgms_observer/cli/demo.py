"""``sgms demo``: both nodes on the ROS graph, recorded, evaluated and drawn."""

from __future__ import annotations

import argparse
import shutil
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sgms_observer.demo.evaluation import Evaluation, Part

NAME = "demo"
HELP = "run a simulated stage and its observer on the ROS graph, record them, and write a report with pictures"

_SHORTEST = 4.0
_WINDOW = 0.8  # s shown of each part


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments.

    Args:
        parser: the command's own parser.
    """
    parser.add_argument("--out", default="out/demo", metavar="DIR", help="folder of the results (default: out/demo)")
    parser.add_argument("--duration", type=float, default=20.0, metavar="S", help="time to record [s] (default: 20)")
    parser.add_argument("--config", metavar="F", help="parameter file (default: the shipped config/demo.yaml)")


def run(args: argparse.Namespace) -> int:
    """Do the job.

    Args:
        args: what the user gave.

    Returns:
        The exit code, 0 only on success.
    """
    from sgms_observer.cli.progress import Progress
    from sgms_observer.demo.evaluation import evaluate
    from sgms_observer.demo.live_run import record_live_run
    from sgms_observer.errors import ConfigurationError, RecordingError
    from sgms_observer.settings.load import load_settings
    from sgms_observer.shipped import shipped_file

    if not args.duration >= _SHORTEST:
        raise ConfigurationError([f"--duration {args.duration:g} s must be at least {_SHORTEST:g} s"])
    config = Path(args.config) if args.config else shipped_file("config", "demo.yaml")
    axis = load_settings(config).axes[0]
    folder, bag = Path(args.out), Path(args.out) / "bag"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if bag.exists():
            shutil.rmtree(bag)  # the last demonstration's
    except OSError as error:
        raise RecordingError(f"{folder} cannot be written: {error.strerror}; choose another folder") from error
    with Progress("demo", round(args.duration * 10)) as progress:
        show = lambda seconds: progress.show(round(seconds * 10))  # noqa: E731
        record_live_run(config, axis.name, bag, args.duration, show, print)
    evaluation = evaluate(bag, axis.name)
    for line in summary(evaluation):
        print(line)
    print(f"report: {_write_report(folder, evaluation, config, bag)}")
    return 0


def summary(evaluation: Evaluation) -> list[str]:
    """Return the figures as lines.

    Args:
        evaluation: a run's figures.
    """
    lines = [_line("compensation off", evaluation.off)]
    if evaluation.on is not None:
        lines.append(_line("compensation on ", evaluation.on))
        lines.append(
            f"tracking error {evaluation.off.tracking_rms / evaluation.on.tracking_rms:.1f} times smaller rms and"
            f" {evaluation.off.tracking_peak / evaluation.on.tracking_peak:.1f} times smaller at its peak"
            " with the compensation"
        )
    return lines


def _line(title: str, part: Part) -> str:
    return (
        f"{title}: friction error {part.friction_rms:.3f} N rms ({part.friction_nrmse:.2f} % of its range),"
        f" two-sigma band holds the truth {100 * part.coverage:.1f} % of the time;"
        f" tracking error {1e6 * part.tracking_rms:.2f} um rms, {1e6 * part.tracking_peak:.2f} um peak"
    )


def _write_report(folder: Path, evaluation: Evaluation, config: Path, bag: Path) -> Path:
    from sgms_observer.report.page import Section, Table, write_page
    from sgms_observer.report.run_pictures import run_pictures

    parts = [("off", evaluation.off)] + ([("on", evaluation.on)] if evaluation.on is not None else [])
    table = Table(
        ("compensation", "friction error rms [N]", "of its range [%]", "band holds truth [%]", "tracking rms [um]",
         "tracking peak [um]"),
        [
            (name, f"{part.friction_rms:.3f}", f"{part.friction_nrmse:.2f}", f"{100 * part.coverage:.1f}",
             f"{1e6 * part.tracking_rms:.2f}", f"{1e6 * part.tracking_peak:.2f}")
            for name, part in parts
        ],
        "After each part has settled.",
    )  # fmt: skip
    counts = Table(
        ("topic", "messages"),
        [(topic, str(count)) for topic, count in sorted(evaluation.messages.items())],
        "What was recorded.",
    )
    sections = [Section("In numbers", tables=(table, counts))]
    for name, part in parts:
        window = (max(part.start, part.end - _WINDOW), part.end)
        pictures = run_pictures(evaluation.run, window, f"compensation-{name}-")
        sections.append(Section(f"Compensation {name}", pictures=pictures))
    verdict = " ".join(f"{line[0].upper()}{line[1:]}." for line in summary(evaluation)[:: len(parts)])
    provenance = f"From {bag}, recorded live on a ROS graph with {config.name}."
    return write_page(folder, "Friction observer: demonstration", verdict, sections, provenance)
