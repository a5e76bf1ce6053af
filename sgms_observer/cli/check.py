"""``sgms check``: check a parameter file, and whether it fits a recording."""

from __future__ import annotations

import argparse
import sys

from sgms_observer.cli.options import add_bag_options, add_output_options, topics_from
from sgms_observer.cli.warn import warn
from sgms_observer.outcome import EXIT_DONE, EXIT_FAILED, Outcome

HELP = "check a parameter file, and whether it fits a recording; print all faults at once"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments, as ``main.Command``."""
    parser.add_argument("config", metavar="YAML", help="parameter file")
    parser.add_argument("bag", nargs="?", metavar="BAG", help="recording to compare it with (default: none)")
    add_bag_options(parser, "all axes of the file")
    add_output_options(parser)


def run(args: argparse.Namespace) -> Outcome:
    """Do the job, as ``main.Command``."""
    from sgms_observer.application.check import check

    found = check(args.config, args.axis or (), args.bag, topics_from(args.topic))
    for fault in found.faults:
        print(fault, file=sys.stderr)
    warn(found.warnings)
    if found.faults:
        return Outcome(EXIT_FAILED, found.as_json())
    print(f"{args.config} is right" + (f" and fits {args.bag}" if args.bag else ""))
    return Outcome(EXIT_DONE, found.as_json())
