"""``sgms export``: write observer and compensation as C, or the simulated stage as an FMU."""

from __future__ import annotations

import argparse

from sgms_observer.cli.options import add_axis_option, add_output_options, add_overwrite_option
from sgms_observer.cli.warn import warn
from sgms_observer.outcome import Outcome

HELP = "write observer and compensation as C (or a ros2_control controller), or the simulated stage as FMU"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments, as ``main.Command``."""
    parser.add_argument("config", metavar="YAML", help="parameter file")
    parser.add_argument(
        "--target",
        required=True,
        choices=("c", "fmu", "ros2_control"),
        help="c: C99 header and source of the observer (EKF) and compensation, with Makefile and test vector;"
        " fmu: the simulated stage with its effects for co-simulation;"
        " ros2_control: a package with a chainable controller around the C source",
    )
    parser.add_argument("--out", required=True, metavar="PATH", help="folder to write, or file of the FMU")
    parser.add_argument("--real", choices=("double", "float"), default="double", help="type in C (default: double)")
    parser.add_argument("--fmi", type=int, choices=(2, 3), default=3, help="version of the FMU (default: 3)")
    add_axis_option(parser, "all; of an FMU the first")
    add_overwrite_option(parser)
    add_output_options(parser)


def run(args: argparse.Namespace) -> Outcome:
    """Do the job, as ``main.Command``."""
    from sgms_observer.application.export import ExportOptions, export

    options = ExportOptions(args.target, tuple(args.axis or ()), args.real, args.fmi, args.overwrite)
    exported = export(args.config, args.out, options)
    warn(exported.warnings)
    print(f"{exported.path}: axis {', '.join(exported.axes)}; {', '.join(exported.files)}")
    if args.target == "c":
        print(f"test it with: make -C {exported.path} test")
    return Outcome(result=exported.as_json())
