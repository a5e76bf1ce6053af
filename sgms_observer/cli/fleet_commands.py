"""Commands over many recordings: options, jobs, a progress bar and the summary.

Imports nothing heavy at its top: ``sgms --help`` reads this.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from sgms_observer.cli.progress import Progress
from sgms_observer.cli.warn import warn
from sgms_observer.errors import ConfigurationError
from sgms_observer.outcome import EXIT_DONE, EXIT_FAILED, EXIT_NOT_USABLE, Outcome

if TYPE_CHECKING:
    from sgms_observer.application.diagnose import DiagnoseRequest
    from sgms_observer.fleet import jobs as fleet


def add_fleet_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare where the jobs of many recordings run."""
    parser.add_argument(
        "--workers",
        type=int,
        metavar="N",
        help="jobs at a time on this machine; the result does not depend on it (default: cores)",
    )
    parser.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="run the jobs of several bags on the Dask cluster at this address, such as tcp://host:8786, whose workers"
        " see the same folders; needs the extra 'fleet'",
    )


def refuse_no_workers(workers: int | None) -> None:
    """Raise the sentence about a number of jobs at a time below one.

    Args:
        workers: as the user gave it; None for one per core.

    Raises:
        ConfigurationError: it is below 1.
    """
    if workers is not None and workers < 1:
        raise ConfigurationError([f"--workers {workers} must be at least 1; leave it out for one per core"])


def replay_many(args: argparse.Namespace, topics: Mapping[str, str]) -> Outcome:
    """Replay several bags.

    Args:
        args: arguments of ``sgms replay``.
        topics: names of the input topics where they differ.

    Returns:
        The worst exit code of the jobs, and the summary.
    """
    from sgms_observer.bags.bag_folder import refuse_existing_bag, refuse_own_recording
    from sgms_observer.fleet.jobs import ReplayJob, job_names

    config, axes = str(Path(args.config).resolve()), tuple(args.axis or ())
    _refuse_configuration(config, axes, takes_one=False)
    out = Path(args.out).resolve()
    bags = [str(Path(bag).resolve()) for bag in args.bags]
    jobs = [
        ReplayJob(name, bag, config, str(out / name), args.storage, dict(topics), axes, is_overwriting=True)
        for name, bag in zip(job_names(args.bags), bags, strict=True)
    ]
    for job in jobs:
        refuse_own_recording(job.out, bags)
        refuse_existing_bag(job.out, args.overwrite)
    return _do("replay", "Replay of a fleet", jobs, args, out, has_page=not args.no_report)


def diagnose_each(args: argparse.Namespace, request: DiagnoseRequest) -> Outcome:
    """Diagnose several bags, each by itself.

    Args:
        args: arguments of ``sgms diagnose``.
        request: what they ask for, as if it were one diagnosis.

    Returns:
        The worst exit code of the jobs, and the summary.
    """
    from sgms_observer.application.diagnose import FILES
    from sgms_observer.bags.bag_folder import find_files, refuse_own_recording
    from sgms_observer.fleet.jobs import DiagnoseJob, job_names
    from sgms_observer.offline.band import refuse_cutoff
    from sgms_observer.whole_file import refuse_existing_files

    config = str(Path(args.config).resolve())
    _refuse_configuration(config, (request.axis,) if request.axis else (), takes_one=True)
    refuse_cutoff(request.cutoff)
    out = Path(args.out).resolve()
    bags, holdout = ([str(Path(bag).resolve()) for bag in given] for given in (request.bags, request.holdout))
    for bag in holdout:
        find_files(Path(bag))  # one that is not there would be the fault of every job
    jobs = []
    for name, bag in zip(job_names(args.bags), bags, strict=True):
        job_request = replace(request, bags=[bag], config=config, out=str(out / name), holdout=holdout, workers=1)
        refuse_own_recording(job_request.out, [*bags, *holdout])
        refuse_existing_files([out / name / file for file in FILES], args.overwrite)
        jobs.append(DiagnoseJob(name, job_request))
    return _do("diagnose", "Diagnosis of a fleet", jobs, args, out, has_page=True)


def _refuse_configuration(config: str, axes: Sequence[str], *, takes_one: bool) -> None:
    """Refuse a parameter file that no job could use: its faults are reported once, not once for each recording."""
    from sgms_observer.settings.load import load_settings
    from sgms_observer.settings.node_parameters import refuse_missing

    settings = load_settings(config)
    wanted = settings.wanted_axes(axes, config)
    refuse_missing(settings, wanted[:1] if takes_one else wanted)


def _do(
    label: str, title: str, jobs: Sequence[fleet.Job], args: argparse.Namespace, out: Path, *, has_page: bool
) -> Outcome:
    """Run the jobs, write the summary, and print what it says."""
    from sgms_observer.bags.bag_folder import REPORT, refuse_bag_folder
    from sgms_observer.fleet.jobs import run_jobs
    from sgms_observer.fleet.summary import SUMMARY, summary_of, verdict, write_summary
    from sgms_observer.whole_file import refuse_existing_files, try_folder

    refuse_bag_folder(out)
    files = [SUMMARY, REPORT] if has_page else [SUMMARY]
    refuse_existing_files([out / name for name in files], args.overwrite)
    try_folder(out)
    with Progress(label, len(jobs)) as progress:
        outcomes = run_jobs(jobs, args.workers or 0, args.scheduler, progress.show)
    write_summary(title, outcomes, out, args.config, has_page=has_page)
    for outcome in outcomes:
        if outcome.fault:
            print(f"{outcome.name}: {outcome.fault}", file=sys.stderr)
        warn(f"{outcome.name}: {warning}" for warning in outcome.figures.get("warnings", ()))
    print(verdict(outcomes))
    results = sum(not outcome.fault for outcome in outcomes)
    print(f"wrote {', '.join(files)} and {results} results in {out}")
    return Outcome(_worst_code(outcomes), summary_of(outcomes))


def _worst_code(outcomes: Sequence[fleet.Outcome]) -> int:
    """Return the exit code of the worst job: no result is worse than one that must not be used."""
    if any(outcome.fault for outcome in outcomes):
        return EXIT_FAILED
    is_usable = all(outcome.figures.get("usable", True) for outcome in outcomes)
    return EXIT_DONE if is_usable else EXIT_NOT_USABLE
