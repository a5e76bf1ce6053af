"""``sgms info``: what is in a bag, and what it can be used for."""

from __future__ import annotations

import argparse

from sgms_observer.cli.options import add_bag_options, add_output_options, topics_from
from sgms_observer.cli.warn import warn
from sgms_observer.outcome import Outcome

HELP = "show what a bag holds (topics, joints, rates, gaps, encoder step, signs) and what it can be used for"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments, as ``main.Command``."""
    parser.add_argument("bag", metavar="BAG", help="the recording")
    parser.add_argument(
        "--joint-type",
        choices=("prismatic", "revolute"),
        help="whether the axes slide (m, N, kg) or turn (rad, N m, kg m^2); without it no units are printed",
    )
    add_bag_options(parser, "all joints of the bag")
    add_output_options(parser)


def run(args: argparse.Namespace) -> Outcome:
    """Do the job, as ``main.Command``."""
    from sgms_observer.application.bag_info import inspect_bag

    info = inspect_bag(args.bag, topics_from(args.topic), args.axis, args.joint_type)
    for line in info.lines():
        print(line)
    warn([*info.warnings, *(warning for axis in info.axes for warning in axis.warnings)])
    return Outcome(result=info.as_json())
