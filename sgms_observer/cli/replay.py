"""``sgms replay``: the observer over a recorded bag, without a ROS graph; the same numbers as the live node."""

from __future__ import annotations

import argparse
import time

from sgms_observer.cli.fleet_commands import add_fleet_arguments, refuse_no_workers
from sgms_observer.cli.options import (
    add_bag_options,
    add_output_options,
    add_overwrite_option,
    add_storage_option,
    topics_from,
)
from sgms_observer.cli.warn import warn
from sgms_observer.outcome import EXIT_DONE, EXIT_NOT_USABLE, Outcome

HELP = "run the observer over a recorded bag and write its estimates into another; deterministic"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments, as ``main.Command``."""
    parser.add_argument("bags", nargs="+", metavar="BAG", help="recorded bag with position and control_effort")
    parser.add_argument("--config", required=True, metavar="F", help="parameter file (YAML)")
    parser.add_argument(
        "--out",
        required=True,
        metavar="BAG2",
        help="folder of the new bag and its report.html; for several, the folder of the new bags and of one summary,"
        " report.html",
    )
    parser.add_argument("--no-report", action="store_true", help="write no report.html")
    add_storage_option(parser, "the new bag")
    add_bag_options(parser, "all axes of the file")
    add_fleet_arguments(parser)
    add_overwrite_option(parser)
    add_output_options(parser)


def run(args: argparse.Namespace) -> Outcome:
    """Do the job, as ``main.Command``."""
    from sgms_observer.application.replay import replay_bag, write_report
    from sgms_observer.cli.progress import Progress

    refuse_no_workers(args.workers)
    if len(args.bags) > 1 or args.scheduler is not None:
        from sgms_observer.cli.fleet_commands import replay_many

        return replay_many(args, topics_from(args.topic))
    start = time.perf_counter()
    with Progress("replay", 1.0) as progress:
        done = replay_bag(args.bags[0], args.config, args.out, args.storage, topics_from(args.topic), progress.show,
                          axes=args.axis, is_overwriting=args.overwrite, has_report=not args.no_report)  # fmt: skip
    seconds = time.perf_counter() - start
    for name, tally in done.tallies.items():
        print(f"{name}: {tally.sentence()}")
    warn(done.warnings)
    print(f"{args.out}: {done.messages} messages in {seconds:.1f} s, {done.duration / seconds:.1f} times real time")
    report = None if args.no_report else write_report(done, args.bags[0], args.config, args.out)
    if report:
        print(f"wrote {report}")
    return Outcome(EXIT_DONE if done.is_usable else EXIT_NOT_USABLE, done.as_json(args.out, report))
