"""``sgms excite``: a reference designed for what is asked, within the table's stroke, speed and acceleration."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sgms_observer.cli.options import (
    ONE_AXIS,
    add_axis_option,
    add_limit_options,
    add_live_topic_option,
    add_output_options,
    add_overwrite_option,
    axis_from,
    live_topics_from,
)
from sgms_observer.cli.warn import warn
from sgms_observer.outcome import Outcome

if TYPE_CHECKING:
    from sgms_observer.arrays import Floats
    from sgms_observer.excitation.reference import Excitation

HELP = (
    "design the motion that identifies the asked parameters or effects best, within the machine's limits; write or"
    " publish it"
)

TOPICS = ("position", "reference")
"""Topics that publishing needs."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments, as ``main.Command``."""
    parser.add_argument("--config", required=True, metavar="YAML", help="parameter file with rough values of the axis")
    parser.add_argument(
        "--out", metavar="CSV", help="file to write: time [s], position [m; rad], velocity [m/s; rad/s]"
    )
    parser.add_argument(
        "--for",
        dest="asked",
        metavar="WHAT",
        help="identify (narrow intervals of all parameters), diagnose (every effect of the catalogue is detectable), or"
        " names of effects to separate from each other, with commas between them (default: identify,diagnose)",
    )
    parser.add_argument("--duration", type=float, metavar="S", help="longest duration (default: 60 s)")
    parser.add_argument(
        "--rate", type=float, metavar="HZ", help="samples per second (default: the file's sample_period)"
    )
    parser.add_argument(
        "--from",
        dest="start",
        type=float,
        metavar="POSITION",
        help="position of the table, where the reference starts and ends [m; rad] (default: the middle of the stroke;"
        " with --publish the position that the table publishes)",
    )
    add_axis_option(parser, ONE_AXIS)
    add_limit_options(parser)
    parser.add_argument("--smallest", type=float, metavar="D", help="smallest reversal (default: 1e-7 m; 1e-5 rad)")
    parser.add_argument(
        "--centre",
        type=float,
        metavar="X",
        help="middle of the stroke [m; rad] (default: where the table stands; 0 in a file without --from)",
    )
    parser.add_argument(
        "--publish", action="store_true", help="publish it in real time as reference; this moves the machine"
    )
    add_live_topic_option(parser, TOPICS)
    add_overwrite_option(parser)
    add_output_options(parser)


def run(args: argparse.Namespace) -> Outcome:
    """Do the job, as ``main.Command``."""
    from sgms_observer.cli.progress import Progress
    from sgms_observer.errors import ConfigurationError
    from sgms_observer.excitation.limits import limits_of
    from sgms_observer.excitation.reference import DURATION, design_excitation
    from sgms_observer.settings.load import load_settings
    from sgms_observer.settings.node_parameters import refuse_missing
    from sgms_observer.whole_file import refuse_existing_files, try_folder
    from sim_plant.reference_file import write_reference_file

    if not args.out and not args.publish:
        raise ConfigurationError(["sgms excite needs --out CSV or --publish; give at least one"])
    if args.publish and args.start is not None:
        raise ConfigurationError(["--publish starts where the table stands; leave out --from"])
    topics = live_topics_from(args.topic, TOPICS)
    if topics and not args.publish:
        raise ConfigurationError(["--topic names topics of the live graph; give --publish too, or leave it out"])
    if args.out:
        if Path(args.out).resolve() == Path(args.config).resolve():
            raise ConfigurationError([f"--out {args.out} is the parameter file itself, which stays; give another name"])
        refuse_existing_files([args.out], args.overwrite)
        try_folder(Path(args.out).parent)
    settings = load_settings(args.config)
    wanted = axis_from(args.axis, "excite")
    axis = settings.wanted_axes([wanted] if wanted else (), args.config)[0]
    refuse_missing(settings, [axis])
    limits = limits_of(axis.joint_type, args.stroke, args.speed, args.acceleration, args.smallest)
    asked = [word.strip() for word in (args.asked or "").split(",") if word.strip()]
    seconds = DURATION if args.duration is None else args.duration
    rate = 1.0 / settings.sample_period if args.rate is None else args.rate
    made: list[Excitation] = []

    def reference_from(start: float) -> tuple[Floats, Floats]:
        """Design the reference, print its summary and write it."""
        with Progress(f"design of {seconds:g} s of motion", 1.0) as progress:
            reference = design_excitation(axis, limits, asked, start, seconds, rate, args.centre, progress.show)
        made.append(reference)
        for sentence in reference.summary:
            print(sentence)
        warn(reference.warnings)
        if args.out:
            write_reference_file(args.out, reference.time, reference.position, reference.velocity)
            print(f"wrote {args.out}: {reference.time[-1]:.2f} s, {len(reference.time)} samples")
        return reference.position, reference.velocity

    if args.publish:
        from sgms_observer.nodes.reference_player import play_reference

        period = settings.sample_period
        finished = play_reference(axis, reference_from, 1.0 / rate, period, limits.acceleration, topics)
        print("published to the end" if finished else "interrupted: the reference was brought to rest")
    else:
        reference_from((args.centre or 0.0) if args.start is None else args.start)
    return Outcome(result=_result(args.out, axis.name, made[0]))


def _result(out: str | None, axis: str, reference: Excitation) -> dict[str, Any]:
    """Return what ``--json`` prints."""
    return {
        "schema": 1,
        "csv": out,
        "axis": axis,
        "duration_s": float(reference.time[-1]),
        "samples": len(reference.time),
        "from": float(reference.position[0]),
        "range": [float(reference.position.min()), float(reference.position.max())],
        "peak_speed": reference.peak_speed,
        "peak_acceleration": reference.peak_acceleration,
        "expected": reference.expected,
        "efficiency": reference.efficiency,
        "hidden": list(reference.hidden),
        "inseparable": list(reference.inseparable),
        "warnings": list(reference.warnings),
        "sections": [
            {"name": part.name, "from_s": part.start, "to_s": part.end, "shows": part.shows}
            for part in reference.sections
        ],
    }
