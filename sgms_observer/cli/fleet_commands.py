"""Commands over many recordings: options, jobs, a progress bar and the summary.

Imports nothing heavy at its top: ``sgms --help`` reads this.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from sgms_observer.cli.options import axis_from
from sgms_observer.cli.progress import Progress
from sgms_observer.cli.warn import warn
from sgms_observer.errors import ConfigurationError

if TYPE_CHECKING:
    from sgms_observer.fleet.jobs import Job


def add_fleet_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare where the jobs of many recordings run."""
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


def replay_many(args: argparse.Namespace, topics: Mapping[str, str]) -> int:
    """Replay several bags.

    Args:
        args: arguments of ``sgms replay``.
        topics: names of the input topics where they differ.

    Returns:
        The exit code, 0 only if every recording gave a result.
    """
    from sgms_observer.fleet.jobs import ReplayJob, job_names

    out = Path(args.out).resolve()
    config = str(Path(args.config).resolve())
    jobs = [
        ReplayJob(
            name,
            str(Path(bag).resolve()),
            config,
            str(out / name),
            args.storage,
            dict(topics),
            args.overwrite or not (out / name).exists(),
        )
        for name, bag in zip(job_names(args.bags), args.bags, strict=True)
    ]
    return _do("replay", "Replay of a fleet", jobs, args, out)


def diagnose_each(args: argparse.Namespace) -> int:
    """Diagnose several bags, each by itself.

    Args:
        args: arguments of ``sgms diagnose``.

    Returns:
        The exit code, 0 only if every recording gave a result.
    """
    from sgms_observer.fleet.jobs import DiagnoseJob, job_names

    out = Path(args.out).resolve()
    config = str(Path(args.config).resolve())
    axis = axis_from(args.axis, "diagnose")
    holdout = tuple(str(Path(bag).resolve()) for bag in args.holdout)
    jobs = [
        DiagnoseJob(name, str(Path(bag).resolve()), holdout, config, str(out / name), axis, args.tolerance, args.seed)
        for name, bag in zip(job_names(args.bags), args.bags, strict=True)
    ]
    return _do("diagnose", "Diagnosis of a fleet", jobs, args, out)


def _do(label: str, title: str, jobs: Sequence[Job], args: argparse.Namespace, out: Path) -> int:
    """Run the jobs, write the summary and print its verdict."""
    from sgms_observer.fleet.jobs import run_jobs
    from sgms_observer.fleet.summary import verdict, write_summary
    from sgms_observer.settings.load import load_settings

    load_settings(args.config)  # its faults are reported once, not once per recording
    if out.exists() and not out.is_dir():
        raise ConfigurationError([f"--out {args.out} is a file; several recordings need a folder"])
    with Progress(label, len(jobs)) as progress:
        outcomes = run_jobs(jobs, args.workers, args.scheduler, progress.show)
    page = write_summary(title, outcomes, out, args.config)
    for outcome in outcomes:
        if outcome.fault:
            print(f"{outcome.name}: {outcome.fault}", file=sys.stderr)
        warn(f"{outcome.name}: {warning}" for warning in outcome.figures.get("warnings", ()))
    print(verdict(outcomes))
    print(f"wrote {page}, summary.json and {sum(not outcome.fault for outcome in outcomes)} results in {out}")
    return 1 if any(outcome.fault for outcome in outcomes) else 0
