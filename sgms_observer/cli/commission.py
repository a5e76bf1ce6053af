"""``sgms commission``: from a table that moves to a compensation that is switched on, in one command."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from sgms_observer.cli.options import (
    ONE_AXIS,
    add_axis_option,
    add_limit_options,
    add_output_options,
    add_overwrite_option,
    axis_from,
    require_ros,
)
from sgms_observer.outcome import EXIT_DONE, EXIT_NOT_USABLE, Outcome

HELP = "lead a machine to its compensation: check, excite, record, identify, diagnose, observe, compensate, compare"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments, as ``main.Command``."""
    parser.add_argument("--config", required=True, metavar="YAML", help="parameter file to start from")
    parser.add_argument(
        "--out", required=True, metavar="DIR", help="folder of all files; a rerun goes on where the last one ended"
    )
    add_axis_option(parser, ONE_AXIS)
    parser.add_argument("--yes", action="store_true", help="move without asking; the motions stay inside the limits")
    parser.add_argument(
        "--time", type=float, default=1800.0, metavar="S", help="begin no step after this time [s] (default: 1800)"
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


def run(args: argparse.Namespace) -> Outcome:
    """Do the job, as ``main.Command``; code 3 where the result must not be used as it is."""
    from sgms_observer.application.commission.run import commission
    from sgms_observer.application.commission.session import Ledger, Plan, Request, Session
    from sgms_observer.cli.progress import Progress
    from sgms_observer.errors import ConfigurationError
    from sgms_observer.whole_file import try_folder

    if not args.time > 0.0:
        raise ConfigurationError([f"--time = {args.time:g} s must be positive; give for instance 1800"])
    if not args.yes and not sys.stdin.isatty():
        raise ConfigurationError(
            ["sgms commission asks before every motion and stdin is no terminal; run it in a terminal, or give --yes"]
        )
    axis = axis_from(args.axis, "commission")
    out = Path(args.out)
    request = Request(args.config, out, axis, args.stroke, args.speed, args.acceleration, args.motion, args.time)
    plan = Plan.of(request)
    try_folder(out)
    ledger = Ledger.open(out, request.as_json(), args.overwrite)
    require_ros()
    from sgms_observer.nodes.table_link import TableLink

    bars: dict[str, Progress] = {}

    def show(title: str, share: float) -> None:
        bars.setdefault(title, Progress(title, 1.0)).show(share)

    def confirm(sentence: str) -> bool:
        print(sentence, flush=True)
        return args.yes or input("Move? [y/N] ").strip().lower() in ("y", "yes")

    def say(sentence: str) -> None:
        print(sentence, flush=True)

    with TableLink(plan.axis, plan.limits, out / "log") as table:
        ledger = commission(Session(plan, ledger, table, confirm, say, show))
    print(f"wrote {out}: commission.json" + (f", {ledger.yaml}" if ledger.yaml else ""))
    if not ledger.is_usable:
        print("Warning: the result must not be used as it is; commission.json says why.", file=sys.stderr)
    return Outcome(EXIT_DONE if ledger.is_usable else EXIT_NOT_USABLE, ledger.as_json())
