"""``sgms diagnose``: find what the model misses, name it, add it, show the gap shrink."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from sgms_observer.fleet.arguments import add_fleet_arguments

if TYPE_CHECKING:
    from sgms_observer.discrepancy.answer import Answer
    from sgms_observer.discrepancy.closing import Closing

NAME = "diagnose"
HELP = "find the effect that the model misses, name it, add it to the model, and show the gap shrink"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments.

    Args:
        parser: the command's own parser.
    """
    parser.add_argument("bags", nargs="+", metavar="BAG", help="recordings with position and control_effort")
    parser.add_argument("--config", required=True, metavar="YAML", help="parameter file with the model as it is now")
    parser.add_argument(
        "--out", required=True, metavar="DIR", help="folder for result.json, augmented.yaml, report.html"
    )
    parser.add_argument(
        "--holdout",
        nargs="+",
        action="extend",
        default=[],
        metavar="BAG",
        help="recordings to judge on, never fitted to",
    )
    parser.add_argument("--axis", metavar="NAME", help="axis to diagnose (default: the first of the YAML)")
    parser.add_argument(
        "--tolerance",
        type=float,
        default=0.05,
        metavar="SHARE",
        help="how far the YAML's mass and friction may be off (default: 0.05)",
    )
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="seed of the null twins (default: 1)")
    parser.add_argument(
        "--each",
        action="store_true",
        help="diagnose every bag by itself, many at once: DIR/BAG/ for each, and one summary, DIR/report.html",
    )
    add_fleet_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Do the job.

    Args:
        args: what the user gave.

    Returns:
        The exit code, 0 only on success.
    """
    from sgms_observer.cli.progress import Progress
    from sgms_observer.errors import ConfigurationError

    if not 0.0 < args.tolerance < 1.0:
        raise ConfigurationError([f"--tolerance {args.tolerance:g} must lie between 0 and 1; 0.05 is five per cent"])
    if args.workers < 0 or args.seed < 0:
        raise ConfigurationError(["--workers and --seed must not be negative; leave them out for the defaults"])
    if args.each:
        from sgms_observer.fleet.command import diagnose_each

        return diagnose_each(args)
    if args.scheduler is not None:
        raise ConfigurationError(["--scheduler is for many diagnoses; add --each, or leave it out"])
    workers = args.workers or os.cpu_count() or 1
    with Progress("diagnose", 1.0) as progress:
        answer, closings = diagnose_bags(
            args.bags, args.holdout, args.config, args.out, args.axis, args.tolerance, args.seed, workers, progress.show
        )
    gap = answer.gap
    print(f"verdict: {answer.verdict} (seed {args.seed})")
    for item in answer.effects:
        values = ", ".join(f"{value:.4g}" for value in item.settings.values)
        others = f"; could also be {', '.join(item.alternatives)}" if item.alternatives else ""
        print(f"  {item.settings.name}: {values} (confidence {item.confidence:.2f}{others})")
    floor = f"(noise floor {gap.floor:.3g} %)"
    print(f"gap on {gap.held_out} data: {gap.before:.3g} -> {gap.after:.3g} % of rms effort {floor}")
    print(f"observer innovation:  {closings[0].innovation:.4g} -> {closings[1].innovation:.4g} N rms")
    left = f"{closings[0].compensation:.4g} -> {closings[1].compensation:.4g}"
    print(f"left to the controller after compensation: {left} N rms")
    if answer.next_experiment:
        print(f"next: {answer.next_experiment}")
    print(f"wrote {args.out}/result.json, augmented.yaml, report.html")
    return 0


def diagnose_bags(
    bags: Sequence[str],
    holdout: Sequence[str],
    config: str,
    out: str,
    axis_name: str | None,
    tolerance: float,
    seed: int,
    workers: int,
    show: Callable[[float], None],
) -> tuple[Answer, tuple[Closing, ...]]:
    """Run the discrepancy workflow and write its three files.

    Args:
        bags: recordings to learn from.
        holdout: recordings to judge on.
        config: parameter file.
        out: folder of result.json, augmented.yaml and report.html.
        axis_name: axis to diagnose; the first of the YAML if None.
        tolerance: how far the YAML's mass and friction may be off, as a share.
        seed: of the null twins.
        workers: threads.
        show: told how much is done, from 0 to 1.

    Returns:
        The answer, and what observer and compensation make of it before and after.

    Raises:
        SgmsError: something cannot be read, written or made sense of.
    """
    from pathlib import Path

    from sgms_observer.discrepancy.answer import answer_of, write
    from sgms_observer.discrepancy.closing import closing
    from sgms_observer.discrepancy.record import read_records
    from sgms_observer.discrepancy.report import write_report
    from sgms_observer.discrepancy.workflow import Options, diagnose
    from sgms_observer.errors import ConfigurationError
    from sgms_observer.settings.load import load_settings
    from sgms_observer.whole_file import try_folder

    settings = load_settings(config)
    names = [axis.name for axis in settings.axes]
    wanted = axis_name or names[0]
    if wanted not in names:
        raise ConfigurationError([f"--axis {wanted} is not in {config}; it has {', '.join(names)}"])
    try_folder(out)
    axis = settings.axes[names.index(wanted)]
    other = next((entry for entry in settings.axes if entry.name != wanted), None)
    options = Options(tolerance, seed, workers)
    learn = [piece for bag in bags for piece in read_records(bag, axis, other)]
    judge = [piece for bag in holdout for piece in read_records(bag, axis, other)]
    found = diagnose(learn, judge, axis, options, lambda _text, share: show(share))
    answer = answer_of(found, options)
    folder = Path(out)
    write(answer, settings, axis.name, folder)
    after = load_settings(folder / "augmented.yaml").axes[names.index(wanted)]
    record = (judge or learn)[0]
    closings = tuple(closing(record, one, record.period) for one in (axis, after))
    write_report(answer, axis, closings, options, folder, [*bags, *holdout])
    return answer, closings
