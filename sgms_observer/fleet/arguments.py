"""The options of commands that take many recordings at once. Imports nothing heavy: ``sgms --help`` reads this."""

from __future__ import annotations

import argparse


def add_fleet_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare where the jobs of many recordings run.

    Args:
        parser: the command's own parser.
    """
    parser.add_argument(
        "--workers",
        type=int,
        default=0,
        metavar="N",
        help="jobs at a time on this machine; the result does not depend on it (default: cores)",
    )
    parser.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="run the jobs of several bags on the Dask cluster at this address, such as tcp://host:8786, whose workers"
        " see the same folders; needs the extra 'fleet'",
    )
