"""Runs jobs in parallel: in processes of this machine, or on a Dask cluster. The order of results is the jobs'."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from typing import Any

from sgms_observer.errors import ConfigurationError, DataError
from sgms_observer.fleet.jobs import DiagnoseJob, Outcome, ReplayJob, run_job

Job = ReplayJob | DiagnoseJob
Show = Callable[[float], None]

_CONNECT = 30.0
"""How long to wait for the scheduler [s]."""

_ENDED = "the process that worked on it ended by itself; try it alone, with more memory"


def run_jobs(jobs: Sequence[Job], workers: int, scheduler: str | None, show: Show) -> list[Outcome]:
    """Do all jobs, each in a process of its own kind, and return what became of them in their order.

    Args:
        jobs: what is to be done.
        workers: jobs at a time on this machine; 0 for one per core.
        scheduler: address of a Dask scheduler, or None for this machine.
        show: told how many jobs are done.

    Raises:
        ConfigurationError: the number of workers makes no sense, or Dask is not installed.
        DataError: the scheduler cannot be reached, or it lost jobs.
    """
    if workers < 0:
        raise ConfigurationError([f"--workers {workers} must not be negative; leave it out for one per core"])
    if scheduler is not None:
        return _on_cluster(jobs, scheduler, show)
    return _on_this_machine(jobs, min(workers or os.cpu_count() or 1, len(jobs)), show)


def _on_this_machine(jobs: Sequence[Job], workers: int, show: Show) -> list[Outcome]:
    """Do the jobs in processes; those that a broken process took along are done again, one by one."""
    found: dict[int, Outcome] = {}
    show(0)
    try:
        for number, outcome in _in_processes(dict(enumerate(jobs)), workers):
            found[number] = outcome
            show(len(found))
        for number, job in enumerate(jobs):
            if number not in found:
                found |= dict(_in_processes({number: job}, 1))
                found.setdefault(number, Outcome(job.name, _ENDED))
                show(len(found))
    except BaseException:
        for process in multiprocessing.active_children():
            process.terminate()
        raise
    return [found[number] for number in range(len(jobs))]


def _in_processes(jobs: dict[int, Job], workers: int) -> Iterator[tuple[int, Outcome]]:
    """Yield number and outcome of each job as it is done, until a process breaks."""
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(workers, mp_context=context, initializer=_leave_signals_to_the_parent)
    try:
        running: dict[Future[Outcome], int] = {pool.submit(run_job, job): number for number, job in jobs.items()}
        for future in as_completed(running):
            try:
                yield running[future], future.result()
            except BrokenProcessPool:
                continue
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


def _leave_signals_to_the_parent() -> None:
    """End silently at Ctrl-C; the command itself says what there is to say."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def _on_cluster(jobs: Sequence[Job], scheduler: str, show: Show) -> list[Outcome]:
    """Do the jobs on a Dask cluster."""
    try:
        from dask.distributed import Client
        from dask.distributed import as_completed as done
    except ImportError:
        raise ConfigurationError(
            ["--scheduler needs Dask, which is not installed; install it with: pip install 'sgms_observer[fleet]'"]
        ) from None
    try:
        client: Any = Client(scheduler, timeout=_CONNECT)
    except (OSError, ValueError, TimeoutError) as error:
        raise DataError(
            f"no Dask scheduler answers at {scheduler} ({type(error).__name__}); check the address and that it runs"
        ) from None
    with client:
        running = {client.submit(run_job, job, pure=False): number for number, job in enumerate(jobs)}
        found: dict[int, Outcome] = {}
        show(0)
        for future in done(list(running)):
            number = running[future]
            lost = future.exception()
            found[number] = Outcome(jobs[number].name, _lost(lost)) if lost is not None else future.result()
            show(len(found))
    return [found[number] for number in range(len(jobs))]


def _lost(error: BaseException) -> str:
    """Return the sentence about a job that the cluster could not do."""
    text = " ".join(str(error).split())
    return f"the cluster could not do it, {type(error).__name__}: {text}; install the same version on its workers"
