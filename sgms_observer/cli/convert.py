"""``sgms convert``: a log of a drive, an instrument or MATLAB into a bag."""

from __future__ import annotations

import argparse
from pathlib import Path

from sgms_observer.cli.options import add_output_options, add_overwrite_option, add_storage_option
from sgms_observer.cli.warn import PREFIX, say
from sgms_observer.outcome import Outcome

HELP = "turn a log (text or MAT) into a bag that replay, identify and diagnose read"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments, as ``main.Command``."""
    parser.add_argument(
        "file", metavar="FILE", type=Path, help="the log: .mat (up to version 7), anything else is a table of text"
    )
    parser.add_argument("--out", required=True, metavar="BAG", help="folder of the new bag")
    parser.add_argument(
        "--map",
        required=True,
        nargs="+",
        action="extend",
        metavar="KEY=COLUMN[*FACTOR]",
        help="which columns are time [s], position [m or rad], control_effort [N or N m] and reference (as position);"
        " the last two are optional. Columns go by name, in a table without names by number (1, 2, ...), in a matrix by"
        " NAME[k]; FACTOR is a number, pi or a single number of the file; sums are possible, as in"
        " control_effort=q1*10.69-q2/2",
    )
    parser.add_argument("--rate", type=float, metavar="HZ", help="samples per second of a log without times [Hz]")
    parser.add_argument(
        "--from", dest="start", type=float, metavar="S", help="leave out what comes before, from the log's start [s]"
    )
    parser.add_argument("--to", dest="end", type=float, metavar="S", help="leave out what comes after, likewise [s]")
    parser.add_argument(
        "--split",
        type=float,
        metavar="SHARE",
        help="write the first SHARE of the time into BAG and the rest into BAG_rest, for --holdout",
    )
    parser.add_argument("--axis", default="x", metavar="NAME", help="name of the axis in the bag (default: x)")
    add_storage_option(parser)
    add_overwrite_option(parser)
    add_output_options(parser)


def run(args: argparse.Namespace) -> Outcome:
    """Do the job, as ``main.Command``."""
    from sgms_observer.application.convert import ConvertOptions, convert

    options = ConvertOptions(args.rate, args.start, args.end, args.split, args.axis, args.storage, args.overwrite)
    converted = convert(args.file, args.map, args.out, options)
    for notice in converted.notices:
        say(notice if notice.startswith(PREFIX) else f"note: {notice}")
    for bag in converted.bags:
        print(f"{bag.path}: {bag.samples} samples of axis {args.axis}, {bag.duration:.6g} s at {bag.rate:.6g} Hz")
    print(f"topics: {', '.join(converted.topics)}")
    return Outcome(result=converted.as_json())
