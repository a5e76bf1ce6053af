"""Many recordings at once: the same results on any number of workers and on Dask, and one fault is one row."""

from __future__ import annotations

import json
import os
import signal
from pathlib import Path

import numpy as np
import pytest
from browser import Browser
from looks import check_report

from sgms_observer.bags.source import BagReader
from sgms_observer.bags.writer import BagWriter
from sgms_observer.cli.main import main
from sgms_observer.errors import ConfigurationError, DataError
from sgms_observer.fleet import jobs as fleet_jobs
from sgms_observer.fleet.jobs import Outcome, ReplayJob, job_names, run_job, run_jobs
from sgms_observer.fleet.summary import write_summary

YAML = """/**:
  ros__parameters:
    axes: [x]
    sample_period: 1.0e-3
    x: {mass: 3.0, filter: {window: 8.0e-3}, estimator: {kind: ekf, correction_every: 2}}
"""


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with settings, three recordings, and one that is broken."""
    folder = tmp_path_factory.mktemp("fleet")
    (folder / "axis.yaml").write_text(YAML)
    chance = np.random.default_rng(3)
    for number in range(3):
        count = 3200 + 500 * number
        phase = 4e-3 * np.pi * np.arange(count)
        stamps = 10**9 + np.arange(count, dtype=np.int64) * 1_000_000
        effort = 4.0 * np.tanh(20.0 * np.cos(phase)) + 0.1 * (1 + 5 * number) * chance.normal(size=count)
        with BagWriter(folder / f"bag{number}") as bag:
            bag.write_joint_states("position", stamps, ("x",), position=1e-3 * np.sin(phase))
            bag.write_joint_states("control_effort", stamps, ("x",), effort=effort)
    (folder / "broken").mkdir()
    (folder / "broken" / "broken_0.mcap").write_bytes(b"nothing")
    return folder


def replay(fleet: Path, out: Path, *more: str) -> int:
    """Replay all recordings of the fleet."""
    bags = [str(fleet / f"bag{number}") for number in range(3)]
    return main(["replay", *bags, "--config", str(fleet / "axis.yaml"), "--out", str(out), *more])


def content(out: Path) -> dict[str, object]:
    """Return everything a fleet's replay wrote that a user reads: summary, page and all messages."""
    found: dict[str, object] = {name: (out / name).read_bytes() for name in ("summary.json", "report.html")}
    for path in sorted(path for path in out.iterdir() if path.is_dir()):
        with BagReader(path) as bag:
            found[path.name] = list(bag.messages())
    return found


def test_results_do_not_depend_on_the_number_of_workers(
    fleet: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for workers in ("1", "2"):
        assert replay(fleet, tmp_path / workers, "--workers", workers) == 0
    assert "3 of 3 recordings gave a result" in capsys.readouterr().out
    first, second = content(tmp_path / "1"), content(tmp_path / "2")
    assert list(first) == ["summary.json", "report.html", "bag0", "bag1", "bag2"]
    assert first == second
    single = tmp_path / "single"
    arguments = ["--config", str(fleet / "axis.yaml"), "--out", str(single)]
    assert main(["replay", str(fleet / "bag1"), *arguments]) == 0
    with BagReader(single) as bag:
        assert list(bag.messages()) == first["bag1"], "one alone is replayed to the same messages"
    listed = json.loads((tmp_path / "1" / "summary.json").read_text())["recordings"]
    assert [entry["axes"]["x"]["samples"] for entry in listed] == [3200, 3700, 4200]


def test_the_summary_reads_well_in_a_browser(fleet: Path, tmp_path: Path, browser: Browser) -> None:
    replay(fleet, tmp_path / "out", "--workers", "1")
    check_report(browser, tmp_path / "out" / "report.html", 0)


def test_a_dask_cluster_gives_the_same(fleet: Path, tmp_path: Path) -> None:
    distributed = pytest.importorskip("dask.distributed", reason="Dask is not installed")
    assert replay(fleet, tmp_path / "here", "--workers", "1") == 0
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=2, processes=False, dashboard_address=None, scheduler_port=0
    ) as cluster:
        assert replay(fleet, tmp_path / "there", "--scheduler", cluster.scheduler_address) == 0
    assert content(tmp_path / "here") == content(tmp_path / "there")


def test_a_worker_that_is_killed_on_the_way_changes_nothing(fleet: Path, tmp_path: Path) -> None:
    """The cluster gives its recording to the worker that is left, which starts it anew."""
    distributed = pytest.importorskip("dask.distributed", reason="Dask is not installed")
    names = [f"bag{number}" for number in range(3)] * 4
    jobs = {
        place: [
            ReplayJob(
                f"{number}",
                str(fleet / name),
                str(fleet / "axis.yaml"),
                str(tmp_path / place / f"{number}"),
                "mcap",
                is_overwriting=True,
            )
            for number, name in enumerate(names)
        ]
        for place in ("here", "there")
    }
    for place in jobs:
        (tmp_path / place).mkdir()
    killed: list[int] = []
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, scheduler_port=0
    ) as cluster:

        def kill_one(done: float) -> None:
            busy = [worker.pid for worker in cluster.scheduler.workers.values() if worker.processing]
            if done >= 2 and busy and not killed:
                os.kill(busy[0], signal.SIGKILL)
                killed.append(busy[0])

        there = run_jobs(jobs["there"], 0, cluster.scheduler_address, kill_one)
    here = [run_job(job) for job in jobs["here"]]
    assert killed and not any(outcome.fault for outcome in there), [outcome.fault for outcome in there]
    assert there == here
    for number in range(len(names)):
        with BagReader(tmp_path / "here" / str(number)) as first, BagReader(tmp_path / "there" / str(number)) as second:
            assert list(first.messages()) == list(second.messages())


def test_one_broken_recording_is_one_row(fleet: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bags = [str(fleet / "broken"), str(fleet / "bag0"), str(fleet / "none")]
    config = ["--config", str(fleet / "axis.yaml"), "--out", str(tmp_path / "out"), "--workers", "1"]
    assert main(["replay", *bags, *config]) == 1
    said = capsys.readouterr()
    assert "1 of 3 recordings gave a result" in said.out
    assert [line.split(":")[0] for line in said.err.splitlines()] == ["broken", "none"]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["bag0", "report.html", "summary.json"]
    page = (tmp_path / "out" / "report.html").read_text()
    assert "2 of 3 recordings gave no result" in page and "does not exist" in page


class _Bomb:
    """A job that ends the process which receives it."""

    name = "bomb"

    def __reduce__(self) -> tuple[object, tuple[int]]:
        return os._exit, (9,)


def test_a_process_that_dies_costs_its_own_job_only(fleet: Path, tmp_path: Path) -> None:
    good = [
        ReplayJob(f"{n}", str(fleet / "bag0"), str(fleet / "axis.yaml"), str(tmp_path / f"{n}"), "mcap")
        for n in range(2)
    ]
    outcomes = run_jobs([good[0], _Bomb(), good[1]], 2, None, lambda done: None)  # type: ignore[list-item]
    assert [bool(outcome.fault) for outcome in outcomes] == [False, True, False]
    assert "ended by itself" in outcomes[1].fault


def test_wrong_places_for_jobs_are_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fleet_jobs, "_CONNECT", 1.0)
    with pytest.raises(ConfigurationError, match="--workers -1"):
        run_jobs([], -1, None, lambda done: None)
    if pytest.importorskip("dask.distributed"):
        with pytest.raises(DataError, match="no Dask scheduler answers at tcp"):
            run_jobs([], 0, "tcp://127.0.0.1:9", lambda done: None)


def test_recordings_of_one_name_get_folders_of_their_own() -> None:
    assert job_names(["a/bag", "b/bag/", "bag.mcap", "c/bag-2", "x.y"]) == ["bag", "bag-2", "bag-3", "bag-2-2", "x.y"]


def test_what_comes_from_recordings_is_escaped(tmp_path: Path) -> None:
    figures = {"duration": 1.0, "messages": 1, "warnings": ["<script>alert(1)</script>"], "axes": {
        "<b>": {"samples": 1, "corrections": 0, "innovation": None, "nis": None, "in_trouble": 0}}}  # fmt: skip
    page = write_summary("title", [Outcome("<i>", "", figures), Outcome("b", "<u>")], tmp_path, "x.yaml").read_text()
    assert not any(tag in page for tag in ("<script>alert", "<b>", "<i>", "<u>"))


def test_diagnoses_do_not_depend_on_the_number_of_workers(fleet: Path, tmp_path: Path) -> None:
    bags = [str(fleet / f"bag{number}") for number in (1, 2)]
    found = []
    for workers in ("1", "2"):
        out = tmp_path / workers
        arguments = ["--config", str(fleet / "axis.yaml"), "--out", str(out), "--workers", workers, "--each"]
        assert main(["diagnose", *bags, "--cutoff", "25", *arguments]) == 0
        found.append({
            str(path.relative_to(out)): path.read_bytes() for path in sorted(out.rglob("*")) if path.suffix != ".png"
            and path.is_file()
        })  # fmt: skip
    assert {"bag1/result.json", "bag2/result.json"} <= found[0].keys() and "summary.json" in found[0]
    assert found[0] == found[1]
    listed = json.loads(found[0]["summary.json"])["recordings"]
    assert all(entry["verdict"] for entry in listed)
