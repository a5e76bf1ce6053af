"""Full disks and folders that refuse: one sentence, nothing half-written under a final name.

A limit on the size of files stands for the full disk: the kernel refuses the write in the same place, also for root.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from ros_graph import ONE_AXIS, Graph, wait_until

from sgms_observer.bags.cdr import JointStateEncoder
from sgms_observer.bags.reader import read_samples
from sgms_observer.bags.writer import BagWriter
from sgms_observer.cli.main import main
from sgms_observer.errors import SgmsError
from sgms_observer.jit import HAS_NUMBA
from sgms_observer.report.page import Page, Section, write_page
from sgms_observer.settings.load import load_settings

REFUSING = Path("/proc/sgms")
ROOT = Path(__file__).resolve().parents[2]
LIMITED = """
import resource, signal, sys
sys.dont_write_bytecode = True  # Python itself would keep bytecode that was cut off
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
size = int(sys.argv.pop(1))
if size:
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
{body}
"""
COMMAND = LIMITED.format(body="from sgms_observer.cli.main import main\nsys.exit(main(sys.argv[1:]))")
PAGE = LIMITED.format(
    body="""
from pathlib import Path
from sgms_observer.errors import SgmsError
from sgms_observer.report.page import Page, Picture, Section, write_page
try:
    picture = Picture("large", "a picture", "<svg></svg>", lambda: b"x" * 400_000)
    write_page(Page("title", "verdict", [Section("part", pictures=[picture])]), Path(sys.argv[1]))
except SgmsError as error:
    sys.exit(str(error))
"""
)
KERNEL = LIMITED.format(
    body="""
import numpy as np
from sgms_observer.diagnosis.motion import play_operator
print(play_operator(np.array([0.0, 1.0, 0.5, 2.0]), 0.25).tolist())
"""
)


Words = list[str | Path]


def run(code: str, size: int, *arguments: str | Path, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run Python code that may write files of so many bytes only (0: any)."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), *sys.path]), **variables}
    command = [sys.executable, "-c", code, str(size), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, env=environment, timeout=120)


def check_refusal(code: int, errors: str) -> None:
    """Check that a command failed with the one sentence."""
    assert code == 1, errors
    assert "cannot be written" in errors and errors.count("\n") == 1, errors


def simulate(folder: Path, out: Path) -> Words:
    """Return a command that simulates."""
    return ["simulate", "--config", folder / "axis.yaml", "--out", out, "--duration", "3"]


def replay(folder: Path, out: Path) -> Words:
    """Return a command that replays."""
    stamps = 10**9 + np.arange(4000, dtype=np.int64) * 1_000_000
    with BagWriter(folder / "source") as bag:
        bag.write_joint_states("position", stamps, ("x",), position=1e-3 * np.sin(0.01 * np.arange(4000)))
        bag.write_joint_states("control_effort", stamps, ("x",), effort=4.0 * np.sign(np.cos(0.01 * np.arange(4000))))
    return ["replay", folder / "source", "--config", folder / "axis.yaml", "--out", out]


def convert(folder: Path, out: Path) -> Words:
    """Return a command that converts."""
    (folder / "log.csv").write_text("t,x\n" + "".join(f"{i * 0.001},{i}\n" for i in range(9000)))
    return ["convert", folder / "log.csv", "--out", out, "--map", "time=t", "position=x"]


def excite(folder: Path, out: Path) -> Words:
    """Return a command that writes a table."""
    return ["excite", "--config", folder / "axis.yaml", "--out", out, "--for", "identify"]


JOBS = (simulate, replay, convert, excite)
of_each_job = pytest.mark.parametrize("job", JOBS, ids=lambda job: job.__name__)


@of_each_job
def test_a_full_disk(job: Callable[[Path, Path], Words], tmp_path: Path) -> None:
    (tmp_path / "axis.yaml").write_text(ONE_AXIS)
    out = tmp_path / "place" / "result"
    done = run(COMMAND, 50_000, *job(tmp_path, out))
    check_refusal(done.returncode, done.stderr)
    check_nothing_left(tmp_path / "place")


def test_a_full_disk_leaves_no_half_page(tmp_path: Path) -> None:
    done = run(PAGE, 50_000, tmp_path / "place" / "result")
    check_refusal(done.returncode, done.stderr)
    check_nothing_left(tmp_path / "place")


@of_each_job
def test_a_folder_that_refuses(
    job: Callable[[Path, Path], Words], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Nobody may make files in /proc, not even root; a file in the place of a folder refuses as well."""
    (tmp_path / "axis.yaml").write_text(ONE_AXIS)
    (tmp_path / "file").write_text("mine")
    words = job(tmp_path, REFUSING)
    for out in (REFUSING, tmp_path / "file" / "result"):
        code = main([str(out if word == REFUSING else word) for word in words])
        check_refusal(code, capsys.readouterr().err)
    assert (tmp_path / "file").read_text() == "mine"


def test_a_folder_that_refuses_a_page(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    for out in (REFUSING, tmp_path / "file" / "result"):
        with pytest.raises(SgmsError, match="cannot be written") as refusal:
            write_page(Page("title", "verdict", [Section("part")]), out)
        assert "\n" not in str(refusal.value)
    assert (tmp_path / "file").read_text() == "mine"


def check_nothing_left(folder: Path) -> None:
    """Check that nothing is left in a folder, under whatever name."""
    assert [path for path in folder.rglob("*") if path.is_file()] == []


LONG = {
    "diagnose": ["diagnose", "bag", "--config", "axis.yaml", "--out"],
    "identify": ["identify", "bag", "--config", "axis.yaml", "--out"],
    "paper": ["paper", "--out"],
    "bench": ["bench", "--json"],
    "bench pictures": ["bench", "--out"],
    "excite": ["excite", "--config", "axis.yaml", "--out"],
}


@pytest.mark.parametrize("name", LONG)
def test_long_work_does_not_begin_where_nothing_can_be_written(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The bag does not exist, which nobody comes to know: the folder is tried first."""
    (tmp_path / "axis.yaml").write_text(ONE_AXIS)
    (tmp_path / "file").write_text("mine")
    words = [str(tmp_path / word) if word in ("bag", "axis.yaml") else word for word in LONG[name]]
    for out in (REFUSING / "x", tmp_path / "file" / "x"):
        code = main([*words, str(out)])
        check_refusal(code, capsys.readouterr().err)


@pytest.mark.parametrize("name", ["diagnose", "identify"])
def test_work_that_ends_before_it_writes_leaves_no_folder(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "axis.yaml").write_text(ONE_AXIS)
    words = [str(tmp_path / word) if word in ("bag", "axis.yaml") else word for word in LONG[name]]
    code = main([*words, str(tmp_path / "new" / "out")])
    errors = capsys.readouterr().err
    assert code == 1 and "does not exist" in errors, errors
    assert not (tmp_path / "new" / "out").exists()


@pytest.mark.skipif(not HAS_NUMBA, reason="there is nothing to keep without numba")
def test_a_kernel_works_where_its_cache_has_no_room(tmp_path: Path) -> None:
    for size, is_kept in ((1_000, False), (0, True)):
        done = run(KERNEL, size, XDG_CACHE_HOME=str(tmp_path))
        assert (done.returncode, done.stdout) == (0, "[0.0, 0.75, 0.75, 1.75]\n"), done.stderr
        assert bool(list(tmp_path.rglob("*.nbc"))) == is_kept


def test_a_full_disk_leaves_whole_files_of_a_diagnosis(tmp_path: Path) -> None:
    (tmp_path / "axis.yaml").write_text(ONE_AXIS)
    stamps = 10**9 + np.arange(10_000, dtype=np.int64) * 1_000_000
    with BagWriter(tmp_path / "still") as bag:  # too little motion to tell anything: soon done
        bag.write_joint_states("position", stamps, ("x",), position=1e-9 * np.sin(0.01 * np.arange(10_000)))
        bag.write_joint_states("control_effort", stamps, ("x",), effort=np.sin(0.02 * np.arange(10_000)))
    words = ["diagnose", tmp_path / "still", "--config", tmp_path / "axis.yaml", "--out"]
    out = tmp_path / "out"
    done = run(COMMAND, 20_000, *words, out)
    check_refusal(done.returncode, done.stderr)
    pictures = list(out.glob("*.png"))
    assert {path.name for path in out.iterdir()} - {path.name for path in pictures} == {"result.json", "augmented.yaml"}
    assert all(picture.read_bytes().endswith(b"IEND\xaeB`\x82") for picture in pictures)
    assert json.loads((out / "result.json").read_text())["verdict"] == "cannot_tell"
    assert load_settings(out / "augmented.yaml").axes[0].mass == 3.0


def test_a_disk_that_fills_up_while_recording(graph: Graph, tmp_path: Path) -> None:
    """The recording ends with a sentence, and what was written before can be read under its preliminary name."""
    out = tmp_path / "bag"
    pipe = subprocess.PIPE
    process = subprocess.Popen(
        [sys.executable, "-c", COMMAND, "50000", "record", "position", "control_effort", "--out", str(out)],
        stdout=pipe, stderr=pipe, text=True, env={**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), *sys.path])},
    )  # fmt: skip
    fields = {"position": "position", "control_effort": "effort"}
    try:
        send = {topic: graph.publisher(topic) for topic in fields}
        encode = {topic: JointStateEncoder(("x",), (field,)).encode for topic, field in fields.items()}

        def has_ended() -> bool:
            stamp = time.time_ns()
            for topic in fields:
                send[topic](encode[topic](stamp, (1.0,)))
            return process.poll() is not None

        wait_until(has_ended, "the recorder to give up")
        _, errors = process.communicate()
    finally:
        process.kill()
    assert process.returncode == 1
    assert "cannot be written" in errors and errors.count("\n") == 1, errors
    assert not out.exists()
    assert sum(block.stamp_ns.size for block in read_samples(tmp_path / "bag.partial", "x", 1e-3)) > 10


def test_a_recording_into_a_folder_that_refuses(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    for out in (REFUSING, tmp_path / "file" / "bag"):
        done = run(COMMAND, 0, "record", "--out", out)
        check_refusal(done.returncode, done.stderr)
