"""``sgms identify``: parameters with intervals from recordings."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from sgms_observer.cli.options import (
    add_bag_options,
    add_output_options,
    add_overwrite_option,
    axes_from,
    topics_from,
)
from sgms_observer.cli.outcome import Outcome

if TYPE_CHECKING:
    from sgms_observer.identification.answer import Answer
    from sgms_observer.offline.recording import Recordings
    from sgms_observer.settings.axis import AxisSettings

NAME = "identify"
HELP = "identify mass, friction, offset and delay from recordings, with intervals"

_LEAST_SQUARES_CUTOFF = 100.0  # Hz


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments.

    Args:
        parser: the command's own parser.
    """
    parser.add_argument("bags", nargs="+", metavar="BAG", help="recordings with position and control_effort")
    parser.add_argument("--config", required=True, metavar="START", help="parameter file to start from")
    parser.add_argument("--out", required=True, metavar="YAML", help="parameter file to write")
    parser.add_argument(
        "--model",
        choices=("sgms", "gms", "least_squares"),
        default="sgms",
        help="friction model, or the inverse dynamic model by least squares (default: sgms)",
    )
    add_bag_options(parser, "all axes of the file")
    parser.add_argument(
        "--elements",
        type=int,
        default=0,
        choices=range(1, 9),
        metavar="N",
        help="elements; held-out error chooses if not given",
    )
    parser.add_argument(
        "--cutoff",
        type=float,
        default=0.0,
        metavar="HZ",
        help="corner of the zero-phase low-pass on the force balance",
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
    from sgms_observer.cli.progress import Progress
    from sgms_observer.errors import ConfigurationError
    from sgms_observer.identification.answer import bag_hash, provenance
    from sgms_observer.offline.recording import Recordings, read_recordings
    from sgms_observer.settings.load import load_settings
    from sgms_observer.settings.write import write_settings
    from sgms_observer.whole_file import refuse_existing_files, try_folder

    refuse_existing_files([args.out], args.overwrite)
    settings = load_settings(args.config)
    wanted = axes_from(args.axis, [axis.name for axis in settings.axes], args.config)
    topics = topics_from(args.topic)
    if args.cutoff < 0.0:
        raise ConfigurationError([f"--cutoff {args.cutoff:g} Hz must be positive; leave it out for the default"])
    try_folder(Path(args.out).parent)
    hashes = [bag_hash(bag) for bag in args.bags]
    changes, remarks = {}, {}
    summary: list[str] = []
    results = {}
    for axis in (axis for axis in settings.axes if axis.name in wanted):
        pieces = Recordings(())
        for bag, digest in zip(args.bags, hashes, strict=True):
            pieces += read_recordings(bag, axis, topics=topics, sha256=digest)
        with Progress(f"identify {axis.name}", 1.0) as progress:
            answer = _identified(pieces, axis, settings.sample_period, args, progress.show)
        changes[axis.name] = answer.changes
        remarks.update({f"{axis.name}.{name}": remark for name, remark in answer.remarks.items()})
        summary += answer.summary
        rows = {row.name: {"value": row.value, "remark": row.remark} for row in answer.rows}
        results[axis.name] = {"parameters": rows, "summary": answer.summary}
        _print(axis.name, answer)
    remarks[""] = provenance(args.bags, hashes, summary)
    write_settings(settings, args.out, changes, remarks)
    load_settings(args.out)
    print(f"wrote {args.out}")
    return Outcome(result={"schema": 1, "yaml": args.out, "axes": results})


def _identified(
    pieces: Recordings,
    axis: AxisSettings,
    sample_period: float,
    args: argparse.Namespace,
    show: Callable[[float], None],
) -> Answer:
    """Identify one axis with the model the user asked for."""
    from sgms_observer.identification.answer import identification_answer, least_squares_answer
    from sgms_observer.identification.identify import IdentifyOptions, identify
    from sgms_observer.identification.least_squares import fit_inverse_model

    if args.model == "least_squares":
        slowest = min(1.0 / piece.period for piece in pieces)
        cutoff = args.cutoff or min(_LEAST_SQUARES_CUTOFF, 0.1 * slowest)
        return least_squares_answer(fit_inverse_model(pieces, cutoff=cutoff), axis)
    options = IdentifyOptions(model=args.model, cutoff=args.cutoff, count=args.elements)
    return identification_answer(identify(pieces, axis, options, show), axis, sample_period)


def _print(name: str, answer: Answer) -> None:
    """Print the table of one axis."""
    for sentence in answer.summary:
        print(sentence)
    width = max(len(row.name) for row in answer.rows)
    for row in answer.rows:
        print(f"  {name}.{row.name:<{width}}  {row.value:12.6g} {row.remark}")
