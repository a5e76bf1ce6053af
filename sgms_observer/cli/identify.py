"""``sgms identify``: parameters with intervals from recordings."""

from __future__ import annotations

import argparse
import contextlib
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from sgms_observer.cli.options import (
    add_bag_options,
    add_holdout_option,
    add_output_options,
    add_overwrite_option,
    topics_from,
)
from sgms_observer.cli.warn import warn
from sgms_observer.outcome import EXIT_DONE, EXIT_NOT_USABLE, Outcome

if TYPE_CHECKING:
    from sgms_observer.identification.answer import Answer

HELP = "identify mass, friction, offset and delay from recordings, with intervals"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments, as ``main.Command``."""
    parser.add_argument("bags", nargs="+", metavar="BAG", help="recordings with position and control_effort")
    parser.add_argument("--config", required=True, metavar="START", help="parameter file to start from")
    parser.add_argument("--out", required=True, metavar="YAML", help="parameter file to write; report.html beside it")
    parser.add_argument(
        "--model",
        choices=("sgms", "gms", "least_squares"),
        default="sgms",
        help="friction model, or the inverse dynamic model by least squares (default: sgms)",
    )
    parser.add_argument(
        "--elements",
        type=int,
        default=0,
        choices=range(1, 9),
        metavar="N",
        help="number of elements (default: chosen by the held-out error)",
    )
    parser.add_argument(
        "--cutoff",
        type=float,
        default=0.0,
        metavar="HZ",
        help="corner frequency of the zero-phase low-pass, upper end of the band (default: chosen from encoder noise"
        " and sample rate)",
    )
    add_holdout_option(parser, "recordings to evaluate the model on, never fitted to")
    add_bag_options(parser, "all axes of the file")
    add_overwrite_option(parser)
    add_output_options(parser)


def run(args: argparse.Namespace) -> Outcome:
    """Do the job, as ``main.Command``; code 3 where a model must not be used as it is."""
    from sgms_observer.application.identify import IdentifyJob, identify_bags

    job = IdentifyJob(
        tuple(args.bags), args.config, args.out, tuple(args.axis or ()), args.model, args.elements, args.cutoff,
        tuple(args.holdout), topics_from(args.topic), args.overwrite,
    )  # fmt: skip
    done = identify_bags(job, _progress)
    warn(done.warnings)
    for axis in done.axes:
        for note in axis.notes:
            print(f"note: {note}")
        _print(axis.name, axis.answer)
    print(f"wrote {done.path} and {done.report}")
    return Outcome(EXIT_DONE if done.is_usable else EXIT_NOT_USABLE, done.as_json())


@contextlib.contextmanager
def _progress(title: str) -> Iterator[Callable[[float], None]]:
    """Show how much is done."""
    from sgms_observer.cli.progress import Progress

    with Progress(title, 1.0) as progress:
        yield progress.show


def _print(name: str, answer: Answer) -> None:
    """Print the table of one axis."""
    for sentence in answer.summary:
        print(sentence)
    width = max(len(row.name) for row in answer.rows)
    for row in answer.rows:
        print(f"  {name}.{row.name:<{width}}  {row.value:12.6g} {row.remark}")
