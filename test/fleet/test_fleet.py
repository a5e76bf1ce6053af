"""Many recordings at once: the same results on any number of workers and on Dask, and one fault is one row."""

from __future__ import annotations

import json
import os
import shutil
import signal
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from browser import Browser
from looks import check_report

from sgms_observer.application.diagnose import DiagnoseRequest
from sgms_observer.bags.source import BagReader
from sgms_observer.bags.writer import BagWriter
from sgms_observer.cli.main import build_parser, main
from sgms_observer.errors import ConfigurationError, DataError
from sgms_observer.fleet import jobs as fleet_jobs
from sgms_observer.fleet.jobs import DiagnoseJob, Outcome, ReplayJob, job_names, run_job, run_jobs
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
    broken, high, none = said.err.splitlines()
    assert (broken.split(":")[0], none.split(":")[0]) == ("broken", "none")
    assert high.startswith("Warning: bag0: ") and "is above 2: the model lacks something" in high
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
    with pytest.raises(ConfigurationError, match="--scheduler is for a cluster"):
        run_jobs([], 2, "tcp://127.0.0.1:9", lambda done: None)
    if pytest.importorskip("dask.distributed"):
        with pytest.raises(DataError, match="no Dask scheduler answers at tcp"):
            run_jobs([], 0, "tcp://127.0.0.1:9", lambda done: None)


def test_recordings_of_one_name_get_folders_of_their_own() -> None:
    assert job_names(["a/bag", "b/bag/", "bag.mcap", "c/bag-2", "x.y"]) == ["bag", "bag-2", "bag-3", "bag-2-2", "x.y"]


def test_what_comes_from_recordings_is_escaped(tmp_path: Path) -> None:
    figures = {"duration": 1.0, "messages": 1, "warnings": ["<script>alert(1)</script>"], "axes": {
        "<b>": {"samples": 1, "corrections": 0, "innovation": None, "nis": None, "in_trouble": 0}}}  # fmt: skip
    page = write_summary("title", [Outcome("<i>", "", figures), Outcome("b", "<u>")], tmp_path, "x.yaml")
    assert page is not None
    text = page.read_text()
    assert not any(tag in text for tag in ("<script>alert", "<b>", "<i>", "<u>"))


def diagnose(fleet: Path, out: Path, *more: str) -> dict[str, bytes]:
    """Diagnose two recordings of the fleet, each by itself; return what was written, without pictures."""
    bags = [str(fleet / f"bag{number}") for number in (1, 2)]
    arguments = ["--config", str(fleet / "axis.yaml"), "--out", str(out), "--each", *more]
    assert main(["diagnose", *bags, "--cutoff", "25", *arguments]) == 0
    files = [path for path in sorted(out.rglob("*")) if path.suffix != ".png" and path.is_file()]
    return {str(path.relative_to(out)): path.read_bytes() for path in files}


@pytest.fixture(scope="module")
def diagnosed(fleet: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """Return what ``diagnose`` writes with one worker on this machine."""
    return diagnose(fleet, tmp_path_factory.mktemp("diagnosed") / "out", "--workers", "1")


def test_diagnoses_do_not_depend_on_the_number_of_workers(
    fleet: Path, diagnosed: dict[str, bytes], tmp_path: Path
) -> None:
    found = [diagnosed, diagnose(fleet, tmp_path / "out", "--workers", "2")]
    assert {"bag1/result.json", "bag2/result.json"} <= found[0].keys() and "summary.json" in found[0]
    assert found[0] == found[1]
    listed = json.loads(found[0]["summary.json"])["recordings"]
    assert all(entry["verdict"] for entry in listed)


def test_a_diagnosis_on_a_cluster_that_loses_a_worker_gives_the_same(
    fleet: Path, diagnosed: dict[str, bytes], tmp_path: Path
) -> None:
    """The worker is killed within a diagnosis; the cluster starts it anew in the same folder."""
    distributed = pytest.importorskip("dask.distributed", reason="Dask is not installed")
    killed: list[str] = []
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, scheduler_port=0
    ) as cluster:

        def kill_one() -> None:
            end = time.monotonic() + 60.0
            while not killed and time.monotonic() < end:
                time.sleep(0.05)
                for worker in list(cluster.scheduler.workers.values()):
                    tasks = {task.key for task in worker.processing}
                    time.sleep(0.5)
                    if tasks & {task.key for task in worker.processing}:  # half a second of it is done
                        os.kill(worker.pid, signal.SIGKILL)
                        killed.append(worker.address)
                        break

        killer = threading.Thread(target=kill_one)
        killer.start()
        try:
            found = diagnose(fleet, tmp_path / "out", "--scheduler", cluster.scheduler_address)
        finally:
            killer.join()
    assert killed
    assert {"bag1/result.json", "bag2/result.json", "summary.json"} <= found.keys()
    assert found == diagnosed


Given = tuple[list[ReplayJob | DiagnoseJob], int, str | None]
OPTIONS = {
    "replay": {
        "--config": ["two.yaml"], "--out": ["elsewhere"], "--no-report": [], "--storage": ["sqlite3"], "--axis": ["y"],
        "--topic": ["position=/joint_states"], "--workers": ["2"], "--scheduler": ["tcp://host:8786"], "--json": [],
        "--quiet": [],
    },
    "diagnose": {
        "--config": ["two.yaml"], "--out": ["elsewhere"], "--holdout": ["bag2"], "--axis": ["y"],
        "--topic": ["position=/joint_states"], "--tolerance": ["0.1"], "--seed": ["7"], "--cutoff": ["25"],
        "--workers": ["2"], "--scheduler": ["tcp://host:8786"], "--json": [], "--quiet": [],
    },
}  # fmt: skip
EACH = {"replay": [], "diagnose": ["--each"]}


def answered(
    fleet: Path, command: str, options: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> tuple[list[Given], str, set[str]]:
    """Return what a fleet's command hands to its jobs, what it prints, and the names that it writes."""
    given: list[Given] = []

    def note(jobs: list[ReplayJob | DiagnoseJob], workers: int, scheduler: str | None, show: object) -> list[Outcome]:
        given.append((jobs, workers, scheduler))
        return [Outcome(job.name, "no result") for job in jobs]

    monkeypatch.setattr(fleet_jobs, "run_jobs", note)
    monkeypatch.chdir(fleet)
    before = set(os.listdir(fleet))
    assert main([command, "bag0", "bag1", "--config", "both.yaml", "--out", "out", *EACH[command], *options]) == 1
    new = set(os.listdir(fleet)) - before
    written = {str(path.relative_to(fleet)) for folder in new for path in (fleet / folder).iterdir()}
    for folder in new:
        shutil.rmtree(fleet / folder)
    return given, capsys.readouterr().out, written


@pytest.mark.parametrize(("command", "option"), [(name, option) for name in OPTIONS for option in OPTIONS[name]])
def test_no_option_of_a_fleet_is_silently_ignored(
    command: str, option: str, fleet: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """--cutoff, --topic, --no-report, --axis and --json had no effect on several recordings."""
    for name, axes in (("both", "x, y"), ("two", "x, y, z")):
        settings = "".join(f"    {axis}: {{mass: 3.0}}\n" for axis in axes.split(", "))
        (fleet / f"{name}.yaml").write_text(f"/**:\n  ros__parameters:\n    axes: [{axes}]\n{settings}")
    plain = answered(fleet, command, [], monkeypatch, capsys)
    assert plain[0], "the jobs are reached"
    assert answered(fleet, command, [option, *OPTIONS[command][option]], monkeypatch, capsys) != plain


@pytest.mark.parametrize("command", OPTIONS)
def test_every_option_of_a_fleet_is_tried(command: str) -> None:
    subparsers = next(action for action in build_parser(command)._actions if action.dest == "command")
    parser = subparsers.choices[command]  # type: ignore[index, call-overload]
    declared = {option for action in parser._actions for option in action.option_strings if option.startswith("--")}
    assert declared == OPTIONS[command].keys() | {"--help", "--overwrite", *EACH[command]}


@pytest.mark.parametrize("command", OPTIONS)
@pytest.mark.parametrize("existing", ["summary.json", "report.html", "bag1"])
def test_a_fleet_replaces_results_only_if_it_may(
    command: str,
    existing: str,
    fleet: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Refused before any work, in one sentence: each job replaced result.json, and the summary another one."""
    monkeypatch.setattr(fleet_jobs, "run_jobs", lambda jobs, *_: [Outcome(job.name, "no result") for job in jobs])
    old = tmp_path / "out" / existing / ("result.json" if command == "diagnose" else "metadata.yaml")
    old = old if existing == "bag1" else old.parent
    old.parent.mkdir(parents=True)
    old.write_text("old")
    bags = [str(fleet / name) for name in ("bag0", "bag1")]
    config = ["--config", str(fleet / "axis.yaml"), "--out", str(tmp_path / "out"), *EACH[command]]
    assert main([command, *bags, *config]) == 1
    printed = capsys.readouterr()
    assert printed.err.endswith("exists already and is not overwritten; give another name, or --overwrite\n")
    assert printed.err.count("\n") == 1 and printed.out == "" and old.read_text() == "old"
    assert len(list(old.parent.iterdir())) == 1
    main([command, *bags, *config, "--overwrite"])
    assert "no result" in capsys.readouterr().err


REFUSED = (
    (["--axis", "nosuch"], "--axis nosuch is not in "),
    (["--workers", "-2"], "--workers"),
    (["--workers", "0"], "--workers 0 must be at least 1; leave it out for one per core"),
    (["--cutoff", "-5"], "--cutoff -5 Hz must be a positive number"),
    (["--cutoff", "nan"], "--cutoff nan Hz must be a positive number"),
    (["--holdout", "none"], "none does not exist"),
    (["--config", "nomass.yaml"], "x.mass must be given"),
    (["--config", "noaxes.yaml"], "axes must be given"),
    (["--out", "."], "--out "),
    (["--topic", "nosuch=/a"], "--topic nosuch=/a"),
)


@pytest.mark.parametrize(
    ("command", "options", "sentence"),
    [(command, *given) for command in OPTIONS for given in REFUSED if given[0][0] in OPTIONS[command]],
)
def test_what_no_job_could_use_is_refused_once(
    command: str,
    options: list[str],
    sentence: str,
    fleet: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """An axis that is not in the file had exit code 0; a missing mass was one row for each recording."""
    (fleet / "nomass.yaml").write_text("/**: {ros__parameters: {axes: [x]}}")
    (fleet / "noaxes.yaml").write_text("/**: {ros__parameters: {x: {mass: 1.0}}}")
    monkeypatch.chdir(fleet)
    before = sorted(os.listdir(fleet))
    config = ["--config", "axis.yaml", "--out", "out", *EACH[command]]
    assert main([command, "bag0", "bag1", *config, *options]) == 1
    printed = capsys.readouterr()
    assert printed.err.startswith(sentence) or sentence in printed.err.partition(";")[0]
    assert printed.err.count("\n") == 1 and printed.out == "" and sorted(os.listdir(fleet)) == before


@pytest.mark.parametrize(
    ("faults", "usable", "code"),
    [(("", ""), (True, True), 0), (("", ""), (True, False), 3), (("broken", ""), (True, False), 1)],
)
def test_the_exit_code_of_a_fleet_is_the_worst_of_its_jobs(
    faults: tuple[str, ...],
    usable: tuple[bool, ...],
    code: int,
    fleet: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    figures = {
        "verdict": "cannot_tell", "warnings": [], "effects": [], "next_experiment": None,
        "gap": {"before": 90.0, "after": 80.0, "floor": 1.0},
    }  # fmt: skip
    found = [
        Outcome(f"bag{n}", f, {**figures, "usable": u}) for n, (f, u) in enumerate(zip(faults, usable, strict=True))
    ]
    monkeypatch.setattr(fleet_jobs, "run_jobs", lambda *_: found)
    arguments = ["--config", str(fleet / "axis.yaml"), "--out", str(tmp_path / "out"), "--each", "--json"]
    assert main(["diagnose", str(fleet / "bag0"), str(fleet / "bag1"), *arguments]) == code
    printed = json.loads(capsys.readouterr().out)
    assert printed == json.loads((tmp_path / "out" / "summary.json").read_text())
    assert ("must not be used as it is" in (tmp_path / "out" / "report.html").read_text()) == (code != 0)


def test_a_job_of_a_diagnosis_uses_its_whole_request(fleet: Path, tmp_path: Path) -> None:
    """The band is the one that --cutoff names, and the topics are those of --topic."""
    config, bag = str(fleet / "axis.yaml"), str(fleet / "bag0")
    request = DiagnoseRequest([bag], config, str(tmp_path / "out"), topics={"position": "/nosuch"})
    assert "/nosuch" in run_job(DiagnoseJob("a", request)).fault
    fault = run_job(DiagnoseJob("b", DiagnoseRequest([bag], config, str(tmp_path / "out"), cutoff=800.0))).fault
    assert fault.startswith("--cutoff 800 Hz must lie between ") and "500 Hz" in fault


@pytest.mark.parametrize("command", ["diagnose", "replay"])
def test_no_worker_is_refused_before_any_work(tmp_path: Path, command: str, capsys: pytest.CaptureFixture[str]) -> None:
    """0 was taken for one job per core, which no page says."""
    arguments = [command, "bag", "--config", "axis.yaml", "--out", str(tmp_path / "out"), "--workers", "0"]
    assert main(arguments) == 1
    assert capsys.readouterr().err == "--workers 0 must be at least 1; leave it out for one per core\n"
