"""``sgms commission``: identify, diagnose and compensate one axis of a machine, in one command."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from sgms_observer.cli.compile import compile_or_warn
from sgms_observer.cli.options import (
    ONE_AXIS,
    add_axis_option,
    add_limit_options,
    add_live_topic_option,
    add_output_options,
    add_overwrite_option,
    axis_from,
    live_topics_from,
    require_ros,
)
from sgms_observer.cli.warn import say, warn
from sgms_observer.outcome import EXIT_DONE, EXIT_NOT_USABLE, Outcome

HELP = "commission one axis: check, record, identify, diagnose, observe, compensate, compare; moves the machine"
TOPICS = ("position", "control_effort", "reference", "friction_compensation")
"""Topics between the command, its observer and the axis."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments, as ``main.Command``."""
    parser.add_argument("--config", required=True, metavar="YAML", help="parameter file to start from")
    parser.add_argument(
        "--out",
        required=True,
        metavar="DIR",
        help="folder of all files; the same command continues after the last finished step",
    )
    add_axis_option(parser, ONE_AXIS)
    add_live_topic_option(parser, TOPICS)
    parser.add_argument("--yes", action="store_true", help="move without asking; the motions stay inside the limits")
    parser.add_argument(
        "--time",
        type=float,
        default=1800.0,
        metavar="S",
        help="time for everything [s]: a step that would not finish in time is skipped; running work is stopped"
        " (default: 1800)",
    )
    add_limit_options(parser)
    parser.add_argument(
        "--motion",
        default="",
        metavar="BAG|CSV",
        help="your own motion, for before and after: a bag with reference, or a CSV with time [s] and position"
        " (default: moves over most of the stroke, a slow one, short steps)",
    )
    add_overwrite_option(parser)
    add_output_options(parser)
    parser.epilog = "Without --yes the command asks on stderr before every motion, with --quiet and --json too."


def run(args: argparse.Namespace) -> Outcome:
    """Do the job, as ``main.Command``; code 3 where the result must not be used as it is."""
    from sgms_observer.application.commission.ledger import LOG, Ledger
    from sgms_observer.application.commission.run import commission
    from sgms_observer.application.commission.session import Plan, Request, Session
    from sgms_observer.bags.bag_folder import refuse_bag_folder
    from sgms_observer.cli.progress import Progress
    from sgms_observer.errors import ConfigurationError
    from sgms_observer.whole_file import try_folder

    if not args.time > 0.0:
        raise ConfigurationError([f"--time = {args.time:g} s must be positive; give for instance 1800"])
    if not args.yes and not sys.stdin.isatty():
        raise ConfigurationError(
            ["sgms commission asks before every motion and stdin is no terminal; run it in a terminal, or give --yes"]
        )
    axis, topics = axis_from(args.axis, "commission"), live_topics_from(args.topic, TOPICS)
    out = Path(args.out)
    limits = (args.stroke, args.speed, args.acceleration)
    request = Request(args.config, out, axis, *limits, args.motion, args.time, topics)
    plan = Plan.of(request)
    refuse_bag_folder(out)
    try_folder(out)
    ledger = Ledger.open(out, request.as_json(), args.overwrite)
    require_ros()
    from sgms_observer.nodes.table_link import TableLink

    bars: dict[str, Progress] = {}

    def show(title: str, share: float) -> None:
        bars.setdefault(title, Progress(title, 1.0)).show(share)

    def announced(motion: str) -> bool:
        say(motion)
        return True

    compile_or_warn()
    ledger.write()
    table = TableLink(plan.axis, plan.limits, out / LOG, topics)
    commission(Session(plan, ledger, table, announced if args.yes else asked, say, show), table)
    print(f"wrote {out}: commission.json, report.html" + (f", {ledger.yaml}" if ledger.yaml else ""))
    if ledger.reason:
        warn([f"the result must not be used as it is: {ledger.reason}."])
    return Outcome(EXIT_DONE if ledger.is_usable else EXIT_NOT_USABLE, ledger.as_json())


def asked(sentence: str) -> bool:
    """Ask on stderr, which --quiet and --json leave alone, whether the axis may move; anything but yes is no.

    Args:
        sentence: describes the motion.
    """
    print(f"{sentence}\nMove? [y/N] ", end="", file=sys.stderr, flush=True)
    return sys.stdin.readline().strip().lower() in ("y", "yes")
