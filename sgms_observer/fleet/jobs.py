"""Jobs over recordings, each a function of plain data, in processes of this machine or on a Dask cluster."""

from __future__ import annotations

import math
import multiprocessing
import os
import signal
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sgms_observer.errors import ConfigurationError, DataError, SgmsError
from sgms_observer.outcome import SHOW_TRACEBACK

if TYPE_CHECKING:
    from sgms_observer.application.diagnose import DiagnoseRequest

Show = Callable[[float], None]

_CONNECT = 30.0
"""How long to wait for the scheduler [s]."""

_ENDED = "the process that worked on it ended by itself; try it alone, with more memory"


@dataclass(frozen=True)
class ReplayJob:
    """The observer over one recording.

    Attributes:
        name: name of the job in the summary, and of its folder.
        bag: the recording.
        config: parameter file.
        out: folder of the new bag.
        storage: ``mcap`` or ``sqlite3``.
        topics: names of the input topics where they differ.
        axes: axes of the file to observe; empty for all.
        is_overwriting: replace what is in the folder: a cluster starts a job again whose worker it lost.
    """

    name: str
    bag: str
    config: str
    out: str
    storage: str
    topics: Mapping[str, str] = field(default_factory=dict)
    axes: tuple[str, ...] = ()
    is_overwriting: bool = False


@dataclass(frozen=True)
class DiagnoseJob:
    """The diagnosis of one recording.

    Attributes:
        name: name of the job in the summary, and of its folder.
        request: inputs and options: one fitted recording, the job's own folder, and one thread.
    """

    name: str
    request: DiagnoseRequest


@dataclass(frozen=True)
class Outcome:
    """Result of a job.

    Attributes:
        name: name of the job.
        fault: the error in one sentence; empty if there is none.
        figures: values for the summary, plain data for JSON.
    """

    name: str
    fault: str = ""
    figures: Mapping[str, Any] = field(default_factory=dict)


def run_job(job: ReplayJob | DiagnoseJob) -> Outcome:
    """Do a job; an error becomes a sentence, so that the other jobs continue.

    Args:
        job: the job.
    """
    try:
        figures = _replay(job) if isinstance(job, ReplayJob) else _diagnose(job)
        return Outcome(job.name, "", figures)
    except SgmsError as error:
        return Outcome(job.name, "; ".join(str(error).splitlines()))
    except OSError as error:
        return Outcome(job.name, f"{error.filename or job.name}: {error.strerror or error}")
    except Exception as error:
        if os.environ.get(SHOW_TRACEBACK):
            traceback.print_exc()
        text = " ".join(str(error).split())
        return Outcome(job.name, f"Internal error, {type(error).__name__}: {text}; report it")


def _replay(job: ReplayJob) -> dict[str, Any]:
    """Replay a recording and return its figures."""
    from sgms_observer.application.replay import replay_bag

    done = replay_bag(
        job.bag, job.config, job.out, job.storage, job.topics, lambda share: None,
        axes=job.axes, is_overwriting=job.is_overwriting,
    )  # fmt: skip
    return {
        "duration": done.duration,
        "messages": done.messages,
        "axes": {name: {**_plain(tally.figures()), "unit": tally.unit} for name, tally in done.tallies.items()},
        "warnings": list(done.warnings),
        "usable": done.is_usable,
    }


def _plain(figures: Mapping[str, float]) -> dict[str, float | None]:
    """Return figures for JSON, which knows no infinity."""
    return {name: value if math.isfinite(value) else None for name, value in figures.items()}


def _diagnose(job: DiagnoseJob) -> dict[str, Any]:
    """Diagnose a recording and return what result.json says."""
    import json

    from sgms_observer.application.diagnose import diagnose_bags

    diagnose_bags(job.request)
    result: dict[str, Any] = json.loads((Path(job.request.out) / "result.json").read_text(encoding="utf-8"))
    return {key: result[key] for key in ("verdict", "usable", "warnings", "gap", "effects", "next_experiment")}


def job_names(bags: list[str]) -> list[str]:
    """Return a name for each recording: its own, with a number after it where several have the same name.

    Args:
        bags: the recordings, in the order of the command line.
    """
    names: list[str] = []
    for bag in bags:
        path = Path(bag)
        stem = path.stem if path.suffix in (".mcap", ".db3") else path.name
        stem = stem or path.resolve().name or "bag"
        name, number = stem, 2
        while name in names:
            name, number = f"{stem}-{number}", number + 1
        names.append(name)
    return names


Job = ReplayJob | DiagnoseJob


def run_jobs(jobs: Sequence[Job], workers: int, scheduler: str | None, show: Show) -> list[Outcome]:
    """Do all jobs, each in a process of its own kind, and return what became of them in their order.

    Args:
        jobs: what is to be done.
        workers: jobs at a time on this machine; 0 for one per core.
        scheduler: address of a Dask scheduler, or None for this machine.
        show: called with the number of finished jobs.

    Raises:
        ConfigurationError: the number of workers makes no sense or is given beside a cluster, or Dask is not installed.
        DataError: the scheduler cannot be reached, or it lost jobs.
    """
    if workers < 0:
        raise ConfigurationError([f"--workers {workers} must be at least 1; leave it out for one per core"])
    if scheduler is not None:
        if workers:
            raise ConfigurationError(
                [f"--workers {workers} is for this machine, and --scheduler is for a cluster; leave one of the two out"]
            )
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
            found[number] = Outcome(jobs[number].name, _lost_sentence(lost)) if lost is not None else future.result()
            show(len(found))
    return [found[number] for number in range(len(jobs))]


def _lost_sentence(error: BaseException) -> str:
    """Return the sentence about a job that the cluster could not do."""
    text = " ".join(str(error).split())
    return f"the cluster could not do it, {type(error).__name__}: {text}; install the same version on its workers"
