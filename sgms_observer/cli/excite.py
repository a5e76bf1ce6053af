"""``sgms excite``: an identification reference within the table's stroke, speed and acceleration."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from sgms_observer.cli.options import (
    add_axis_option,
    add_output_options,
    add_overwrite_option,
    axes_from,
    axis_from,
)
from sgms_observer.cli.outcome import Outcome

if TYPE_CHECKING:
    from sgms_observer.identification.excitation import Excitation

NAME = "excite"
HELP = "write (or publish) a reference that shows friction: nested reversals, traverses, fast moves, dwells"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments.

    Args:
        parser: the command's own parser.
    """
    parser.add_argument("--config", required=True, metavar="YAML", help="parameter file with rough values of the axis")
    parser.add_argument(
        "--out", metavar="CSV", help="file to write: time [s], position [m; rad], velocity [m/s; rad/s]"
    )
    add_axis_option(parser, "the first of the file")
    parser.add_argument(
        "--stroke", type=float, metavar="WIDTH", help="full width of the motion (default: 0.02 m; 0.5 rad)"
    )
    parser.add_argument("--speed", type=float, metavar="V", help="largest speed (default: 0.05 m/s; 0.5 rad/s)")
    parser.add_argument(
        "--acceleration", type=float, metavar="A", help="largest acceleration (default: 1 m/s^2; 2 rad/s^2)"
    )
    parser.add_argument("--smallest", type=float, metavar="D", help="smallest reversal (default: 1e-7 m; 1e-5 rad)")
    parser.add_argument(
        "--centre",
        type=float,
        metavar="X",
        help="position in the middle [m; rad] (default: 0 in the file; where the axis stands when publishing)",
    )
    parser.add_argument(
        "--publish", action="store_true", help="publish it in real time as reference (sensor_msgs/JointState)"
    )
    add_overwrite_option(parser)
    add_output_options(parser)


def run(args: argparse.Namespace) -> Outcome:
    """Do the job.

    Args:
        args: what the user gave.

    Returns:
        The exit code and the result.
    """
    from dataclasses import replace

    import numpy as np

    from sgms_observer.errors import ConfigurationError
    from sgms_observer.identification.excitation import CAUTIOUS_LIMITS, build_excitation
    from sgms_observer.settings.load import load_settings
    from sgms_observer.whole_file import refuse_existing_files

    if not args.out and not args.publish:
        raise ConfigurationError(["sgms excite needs --out CSV or --publish; give at least one"])
    if args.out:
        refuse_existing_files([args.out], args.overwrite)
    settings = load_settings(args.config)
    names = [axis.name for axis in settings.axes]
    name = axes_from([axis_from(args.axis, NAME) or names[0]], names, args.config)[0]
    axis = settings.axes[names.index(name)]
    given = {name: getattr(args, name) for name in ("stroke", "speed", "acceleration", "smallest")}
    limits = replace(
        CAUTIOUS_LIMITS[axis.joint_type], **{name: value for name, value in given.items() if value is not None}
    )
    reference = build_excitation(axis, limits, settings.sample_period)
    for section in reference.sections:
        print(f"{section.start:8.2f} s to {section.end:8.2f} s: {section.name}, for {section.shows}")
    readable = axis.units.readable
    low, high = float(reference.position.min()), float(reference.position.max())
    print(
        f"{axis.name}: from {readable(low)} to {readable(high)} around the start, at most"
        f" {readable(float(abs(reference.velocity).max()), 'm/s')} and"
        f" {readable(float(abs(np.diff(reference.velocity)).max()) / settings.sample_period, 'm/s^2')},"
        f" {reference.time[-1]:.2f} s"
    )
    if args.out:
        _write(args.out, reference, args.centre or 0.0)
        print(f"wrote {args.out}: {reference.time[-1]:.2f} s, {len(reference.time)} samples")
    if args.publish:
        from sgms_observer.nodes.reference_player import play_reference

        finished = play_reference(
            axis, reference.position, reference.velocity, settings.sample_period, limits.acceleration, args.centre
        )
        print("published to the end" if finished else "interrupted: the reference was brought to rest")
    sections = [
        {"name": part.name, "from_s": part.start, "to_s": part.end, "shows": part.shows} for part in reference.sections
    ]
    return Outcome(
        result={
            "schema": 1,
            "csv": args.out,
            "axis": axis.name,
            "duration_s": float(reference.time[-1]),
            "samples": len(reference.time),
            "sections": sections,
        }
    )


def _write(path: str, reference: Excitation, centre: float) -> None:
    """Write the reference as CSV; the simulated stage reads it as reference.kind: file."""
    from sgms_observer.settings.write import write_text

    rows = zip(reference.time, reference.position + centre, reference.velocity, strict=True)
    lines = [f"{time:.9g},{position:.12f},{velocity:.9g}" for time, position, velocity in rows]
    write_text("\n".join(["time,position,velocity", *lines]) + "\n", path)
