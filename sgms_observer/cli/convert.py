"""``sgms convert``: a log of a drive or of MATLAB into a bag."""

from __future__ import annotations

import argparse
from pathlib import Path

NAME = "convert"
HELP = "turn a log (CSV or MAT) into a bag that replay, identify and diagnose read"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments.

    Args:
        parser: the command's own parser.
    """
    parser.add_argument("file", metavar="FILE", type=Path, help="the log: .mat (up to version 7), anything else is CSV")
    parser.add_argument("--out", required=True, metavar="BAG", help="folder of the new bag")
    parser.add_argument(
        "--map",
        required=True,
        nargs="+",
        action="extend",
        metavar="KEY=COLUMN[*FACTOR]",
        help="which column is time [s], position [m], control_effort [N] and reference [m] (the last two optional);"
        " FACTOR is a number or a single number of the file, as in control_effort=vir*gtau",
    )
    parser.add_argument("--axis", default="x", metavar="NAME", help="name of the axis in the bag (default: x)")
    parser.add_argument(
        "--storage", choices=("mcap", "sqlite3"), default="mcap", help="storage of the bag (default: mcap)"
    )


def run(args: argparse.Namespace) -> int:
    """Do the job.

    Args:
        args: what the user gave.

    Returns:
        The exit code, 0 only on success.
    """
    from sgms_observer.bags.conversion import parse_map, read_table, write_table

    table = read_table(args.file, parse_map(args.map))
    write_table(table, args.out, args.axis, args.storage)
    for notice in table.notices:
        print(f"note: {notice}")
    topics = ["position"]
    topics += ["control_effort"] if table.control_effort is not None else []
    topics += ["reference"] if table.reference is not None else []
    count = table.stamp_ns.size
    duration = (table.stamp_ns[-1] - table.stamp_ns[0]) * 1e-9
    print(f"{args.out}: {count} samples of axis {args.axis}, {duration:.6g} s at {(count - 1) / duration:.6g} Hz")
    print(f"topics: {', '.join(topics)}")
    return 0
