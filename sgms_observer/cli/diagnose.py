"""``sgms diagnose``: find what the model lacks, name it, add it, and show how far the gap falls."""

from __future__ import annotations

import argparse
import json
import os
from pathlib import Path
from typing import TYPE_CHECKING

from sgms_observer.cli.fleet_commands import add_fleet_arguments, refuse_no_workers
from sgms_observer.cli.options import (
    ONE_AXIS,
    add_bag_options,
    add_holdout_option,
    add_output_options,
    add_overwrite_option,
    axis_from,
    topics_from,
)
from sgms_observer.cli.warn import warn
from sgms_observer.outcome import EXIT_DONE, EXIT_NOT_USABLE, Outcome

if TYPE_CHECKING:
    from sgms_observer.application.diagnose import DiagnoseResult

HELP = "find the effects that the model lacks, name them, add them to the model, and show how far the gap falls"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments, as ``main.Command``."""
    parser.add_argument("bags", nargs="+", metavar="BAG", help="recordings with position and control_effort")
    parser.add_argument("--config", required=True, metavar="YAML", help="parameter file with the model as it is now")
    parser.add_argument(
        "--out", required=True, metavar="DIR", help="folder for result.json, augmented.yaml, report.html, residual.mcap"
    )
    add_holdout_option(parser, "recordings to evaluate the model on, never fitted to")
    add_bag_options(parser, ONE_AXIS)
    parser.add_argument(
        "--tolerance",
        type=float,
        default=0.05,
        metavar="SHARE",
        help="how far the YAML's mass and friction may be off (default: 0.05)",
    )
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="seed of all random numbers (default: 1)")
    parser.add_argument(
        "--cutoff",
        type=float,
        default=0.0,
        metavar="HZ",
        help="compare measured and modelled effort below this frequency (default: from sample rate and encoder)",
    )
    parser.add_argument(
        "--each",
        action="store_true",
        help="diagnose every bag by itself, many at once: DIR/BAG/ for each, and one summary, DIR/report.html",
    )
    add_fleet_arguments(parser)
    add_overwrite_option(parser)
    add_output_options(parser)


def run(args: argparse.Namespace) -> Outcome:
    """Do the job, as ``main.Command``."""
    from sgms_observer.application.diagnose import FILES, DiagnoseRequest, diagnose_bags
    from sgms_observer.cli.progress import Progress
    from sgms_observer.diagnosis.named import NOT_DETERMINED
    from sgms_observer.diagnosis.report import sentence
    from sgms_observer.effects.catalogue import effect
    from sgms_observer.errors import ConfigurationError
    from sgms_observer.freed_memory import keep_freed_memory
    from sgms_observer.whole_file import refuse_existing_files

    if not 0.0 < args.tolerance < 1.0:
        raise ConfigurationError([f"--tolerance {args.tolerance:g} must lie between 0 and 1; 0.05 is five per cent"])
    refuse_no_workers(args.workers)
    if args.seed < 0:
        raise ConfigurationError([f"--seed {args.seed} must not be negative; leave it out for the default"])
    axis = axis_from(args.axis, "diagnose")
    workers = args.workers or os.cpu_count() or 1
    request = DiagnoseRequest(
        args.bags, args.config, args.out, args.holdout, axis, topics_from(args.topic), args.tolerance, args.cutoff,
        args.seed, workers,
    )  # fmt: skip
    if args.each:
        from sgms_observer.cli.fleet_commands import diagnose_each

        return diagnose_each(args, request)
    if args.scheduler is not None:
        raise ConfigurationError(["--scheduler is for many diagnoses; add --each, or leave it out"])
    refuse_existing_files([Path(args.out) / name for name in FILES], args.overwrite)
    keep_freed_memory()
    with Progress("diagnose", 1.0) as progress:
        done = diagnose_bags(request, progress.show)
    answer, gap, effort_unit = done.answer, done.answer.gap, done.units.effort
    warn(f"{warning}." for warning in answer.warnings)
    for note in done.notes:
        print(f"note: {note}")
    print(f"verdict: {answer.verdict} (seed {args.seed})")
    print(f"  {sentence(answer, done.units)}")
    for item in answer.effects:
        entry = effect(item.settings.name)
        values = ", ".join(
            f"{parameter.name} {NOT_DETERMINED}"
            if parameter.name in item.undetermined
            else f"{parameter.name} {value:.4g} {done.units.of(parameter.unit)}".removesuffix(" -")
            for parameter, value in zip(entry.parameters, item.settings.values, strict=True)
        )
        others = f", may also be {' or '.join(item.alternatives)}" if item.alternatives else ""
        print(f"  {entry.name}, confidence {item.confidence:.{3 if others else 2}f}{others}: {values}")
    for learnt in answer.learnt:
        print(f"  learnt: {learnt.sentence}")
        if learnt.formula:
            print(f"    a formula predicts as well: {learnt.formula.text}")
    for changed in answer.changed:
        unit = "" if isinstance(changed.after, str) else done.units.of(changed.unit)
        print(f"  changed: {changed.name}: {_shown(changed.before)} -> {_shown(changed.after)} {unit}".rstrip())
    maps = f", {answer.gap_with_learnt:.3g} with learnt maps" if answer.learnt else ""
    print(
        f"gap on {gap.held_out} data below {gap.band:.4g} Hz, in % of the rms effort: {gap.given:.3g} with the file as"
        f" given, {gap.before:.3g} refitted, {gap.after:.3g} with the effects and changed values{maps};"
        f" {gap.floor:.3g} is not predictable"
    )
    print(
        f"  with equal weight for all samples, also at rest: {gap.unweighted_before:.3g} refitted,"
        f" {gap.unweighted_after:.3g} with the effects and changed values{', without learnt maps' if maps else ''}"
    )
    print(f"observer innovation: {done.checks[0].innovation:.4g} -> {done.checks[1].innovation:.4g} {effort_unit} rms")
    before, after = done.checks
    print(
        f"friction not cancelled by the feedforward: {before.friction_not_cancelled:.4g} ->"
        f" {after.friction_not_cancelled:.4g} {effort_unit} rms along {after.along}"
        f" (while it moves, {100.0 * after.share:.0f} % of the time)"
    )
    print(_tracking(done))
    if answer.next_experiment:
        print(f"next: {answer.next_experiment}")
    print(f"wrote {args.out}/{', '.join(FILES)}")
    result = json.loads((Path(args.out) / FILES[0]).read_text(encoding="utf-8"))
    return Outcome(EXIT_DONE if answer.usable else EXIT_NOT_USABLE, result)


def _tracking(done: DiagnoseResult) -> str:
    """Return a line about the tracking error that the model predicts."""
    if done.tracking is None:
        return "predicted tracking error: none, the simulated loop does not stay finite with stage.controller"
    return done.tracking.sentence(done.units)


def _shown(value: float | str) -> str:
    """Return a value of the file for people."""
    return value if isinstance(value, str) else f"{value:.4g}"
