"""``sgms identify``: parameters with intervals from recordings."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

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
    parser.add_argument("--axis", action="append", metavar="NAME", help="identify this axis only (may be repeated)")
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


def run(args: argparse.Namespace) -> int:
    """Do the job.

    Args:
        args: what the user gave.

    Returns:
        The exit code, 0 only on success.
    """
    from sgms_observer.cli.progress import Progress
    from sgms_observer.errors import ConfigurationError
    from sgms_observer.identification.answer import bag_hash, provenance
    from sgms_observer.offline.recording import Recordings, read_recordings
    from sgms_observer.settings.load import load_settings
    from sgms_observer.settings.write import write_settings
    from sgms_observer.whole_file import try_folder

    settings = load_settings(args.config)
    known = [axis.name for axis in settings.axes]
    wanted = args.axis or known
    strange = [name for name in wanted if name not in known]
    if strange:
        raise ConfigurationError([f"--axis {strange[0]} is not in {args.config}; it has {', '.join(known)}"])
    if args.cutoff < 0.0:
        raise ConfigurationError([f"--cutoff {args.cutoff:g} Hz must be positive; leave it out for the default"])
    try_folder(Path(args.out).parent)
    hashes = [bag_hash(bag) for bag in args.bags]
    changes, remarks = {}, {}
    summary: list[str] = []
    for axis in (axis for axis in settings.axes if axis.name in wanted):
        pieces = Recordings(())
        for bag, digest in zip(args.bags, hashes, strict=True):
            pieces += read_recordings(bag, axis.name, sha256=digest)
        with Progress(f"identify {axis.name}", 1.0) as progress:
            answer = _identified(pieces, axis, settings.sample_period, args, progress.show)
        changes[axis.name] = answer.changes
        remarks.update({f"{axis.name}.{name}": remark for name, remark in answer.remarks.items()})
        summary += answer.summary
        _print(axis.name, answer)
    remarks[""] = provenance(args.bags, hashes, summary)
    write_settings(settings, args.out, changes, remarks)
    load_settings(args.out)
    print(f"wrote {args.out}")
    return 0


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
