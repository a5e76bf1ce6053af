"""Many recordings at once: a plain loop, and Dask clusters of one and two worker processes, one of which is killed.

    python benchmarks/fleet.py --bags 40

makes recordings of a simulated axis, replays (or, with ``--diagnose``, diagnoses) all of them in each way, and prints
what a worker does in a second and whether every result is the same, as JSON.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import signal
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from dask.distributed import Client, LocalCluster

from sgms_observer.application.diagnose import DiagnoseRequest
from sgms_observer.bags.source import BagReader
from sgms_observer.cli.main import main as sgms
from sgms_observer.fleet.jobs import DiagnoseJob, Outcome, ReplayJob, run_job, run_jobs

SEEDS = 4  # different recordings; the others are these again
KILLED_AT = 0.25  # share of the jobs that are done when a worker is killed
YAML = """/**:
  ros__parameters:
    axes: [x]
    sample_period: 1.0e-3
    x:
      mass: 3.0
      filter: {window: 8.0e-3}
      estimator: {correction_every: 2}
      stage: {encoder: {noise: 5.0e-9}, force_noise: 0.1, reference: {kind: sine, amplitude: 5.0e-4, frequency: 2.0}}
"""

Job = ReplayJob | DiagnoseJob


def make_bags(folder: Path, count: int, seconds: float) -> list[Path]:
    """Return recordings of one simulated axis with different noise.

    Args:
        folder: where to.
        count: how many.
        seconds: length of each [s].
    """
    (folder / "axis.yaml").write_text(YAML)
    config = ["--config", str(folder / "axis.yaml"), "--duration", str(seconds), "--quiet"]
    made = [folder / f"seed{seed}" for seed in range(SEEDS)]
    for seed, bag in enumerate(made):
        if sgms(["simulate", *config, "--out", str(bag), "--seed", str(seed)]) != 0:
            raise SystemExit("the recordings could not be made")
    return [made[number % SEEDS] for number in range(count)]


def jobs_of(bags: list[Path], config: Path, out: Path, is_diagnosis: bool) -> list[Job]:
    """Return one job for each recording.

    Args:
        bags: the recordings.
        config: parameter file.
        out: folder of the results.
        is_diagnosis: diagnose instead of replay.
    """
    out.mkdir()
    if is_diagnosis:
        return [
            DiagnoseJob(f"{n}", DiagnoseRequest([str(bag)], str(config), str(out / f"{n}"), tolerance=0.1, seed=0))
            for n, bag in enumerate(bags)
        ]
    return [
        ReplayJob(f"{n}", str(bag), str(config), str(out / f"{n}"), "mcap", is_overwriting=True)
        for n, bag in enumerate(bags)
    ]


def first_of(job: Job, number: int) -> Job:
    """Return a job whose result goes beside its own folder.

    Args:
        job: the job.
        number: of the worker that does it.
    """
    if isinstance(job, ReplayJob):
        return replace(job, out=f"{job.out}_first_of_{number}")
    return replace(job, request=replace(job.request, out=f"{job.request.out}_first_of_{number}"))


def on_cluster(jobs: list[Job], workers: int, is_killed: bool) -> tuple[list[Outcome], float]:
    """Return what became of the jobs, and how long they took [s].

    Args:
        jobs: what is to be done.
        workers: processes with one thread each.
        is_killed: whether one of them is killed on the way.
    """
    with LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None, scheduler_port=0) as cluster:
        with Client(cluster) as client:  # imports and kernels, in every worker
            first = [first_of(jobs[0], number) for number in range(workers)]
            places = zip(first, list(client.scheduler_info()["workers"]), strict=True)
            client.gather([client.submit(run_job, job, workers=[address], pure=False) for job, address in places])
        killed: list[int] = []

        def watch(done: float) -> None:
            busy = [worker.pid for worker in cluster.scheduler.workers.values() if worker.processing]
            if is_killed and busy and not killed and done >= KILLED_AT * len(jobs):
                os.kill(busy[0], signal.SIGKILL)
                killed.append(busy[0])

        start = time.perf_counter()
        found = run_jobs(jobs, 0, cluster.scheduler_address, watch)
        return found, time.perf_counter() - start


def plain_loop(jobs: list[Job]) -> tuple[list[Outcome], float]:
    """Return the same for a loop in this process.

    Args:
        jobs: what is to be done.
    """
    run_job(jobs[0])  # imports and kernels
    start = time.perf_counter()
    found = [run_job(job) for job in jobs[1:]]
    return [run_job(jobs[0]), *found], (time.perf_counter() - start) * len(jobs) / (len(jobs) - 1)


def content(out: Path, count: int) -> list[str]:
    """Return a digest of what each job wrote: messages of a replayed bag, bytes of a result.

    Args:
        out: folder of the results.
        count: how many there are.
    """
    found = []
    for folder in (out / f"{number}" for number in range(count)):
        digest = hashlib.sha256()
        if (folder / "result.json").exists():
            digest.update((folder / "result.json").read_bytes())
        else:
            with BagReader(folder) as bag:
                for topic, stamp, message in bag.messages():
                    digest.update(f"{topic} {stamp} ".encode())
                    digest.update(message)
        found.append(digest.hexdigest())
    return found


def measure(count: int, seconds_each: float, is_diagnosis: bool) -> dict[str, Any]:
    """Return the table.

    Args:
        count: recordings.
        seconds_each: length of each [s].
        is_diagnosis: diagnose instead of replay.
    """
    with tempfile.TemporaryDirectory(prefix="sgms-fleet-") as name:
        folder = Path(name)
        bags = make_bags(folder, count, seconds_each)
        ways: dict[str, tuple[int, Callable[[list[Job]], tuple[list[Outcome], float]]]] = {
            "loop": (1, plain_loop),
            "one_worker": (1, lambda jobs: on_cluster(jobs, 1, False)),
            "two_workers": (2, lambda jobs: on_cluster(jobs, 2, False)),
            "two_workers_one_killed": (2, lambda jobs: on_cluster(jobs, 2, True)),
        }
        rows: dict[str, Any] = {}
        first: list[str] = []
        for way, (workers, work) in ways.items():
            jobs = jobs_of(bags, folder / "axis.yaml", folder / way, is_diagnosis)
            outcomes, seconds = work(jobs)
            written = content(folder / way, count)
            first = first or written
            rows[way] = {
                "seconds": round(seconds, 2),
                "recordings_per_second_and_worker": round(count / seconds / workers, 3),
                "faults": [outcome.fault for outcome in outcomes if outcome.fault],
                "is_identical": written == first,
            }
        return {"recordings": count, "seconds_each": seconds_each, "load": os.getloadavg()[0], "ways": rows}


def main() -> int:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bags", type=int, default=40)
    parser.add_argument("--seconds", type=float, default=10.0, help="length of each recording (default: 10 s)")
    parser.add_argument("--diagnose", action="store_true")
    args = parser.parse_args()
    print(json.dumps(measure(args.bags, args.seconds, args.diagnose), indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
