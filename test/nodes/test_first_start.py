"""The first start after an installation: kernels are compiled in processes of their own, and the node answers."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from ros_graph import ONE_AXIS, Graph, NodeProcess, Start, wait_until

from sgms_observer import jit
from sgms_observer.application import kernels
from sgms_observer.application.kernels import PARTS, Compilation, missing_parts

pytestmark = pytest.mark.skipif(not jit.HAS_NUMBA, reason="without numba nothing is compiled")


@pytest.fixture
def empty_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Have kernels kept in a folder that is empty."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(jit, "_CACHE", tmp_path / "cache" / "sgms_observer" / "kernels")
    return tmp_path / "cache"


def _children(process: NodeProcess) -> list[str]:
    return Path(f"/proc/{process.process.pid}/task/{process.process.pid}/children").read_text().split()


@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGTERM])
def test_a_node_answers_while_its_kernels_compile(
    graph: Graph, start: Start, empty_cache: Path, end: signal.Signals
) -> None:
    process = start("observer_node", ONE_AXIS, wait=False)
    wait_until(lambda: "compiling the numerical kernels" in process.text(), "the compilation")
    assert graph.state("observer_node") == "unconfigured"
    compilers = _children(process)
    assert compilers and "active" not in process.text()
    assert process.stop(end) == 0
    for compiler in compilers:
        wait_until(lambda pid=compiler: not Path(f"/proc/{pid}").exists(), "the end of the compilers")


class SaidCompiler:
    """Stands for a part's process: in every turn of the clock it says that one function more is compiled."""

    def __init__(self, functions: int) -> None:
        self._left = functions
        self.stdout = self
        self.returncode = 0

    def read(self) -> bytes:
        """Return what was said since the last time."""
        self._left -= 1
        return b"." if self._left >= 0 else b""

    def poll(self) -> int | None:
        """Return the exit code once everything is compiled."""
        return None if self._left > 0 else 0


def test_what_is_left_is_estimated_from_what_was_done(empty_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """At a steady pace, as much time as has gone by is left when half is done; nothing is told in the first seconds."""
    turn, now = 0.5, [100.0]
    count = PARTS["filter"].functions
    monkeypatch.setattr(kernels, "time", SimpleNamespace(monotonic=lambda: now[0]))
    monkeypatch.setattr(kernels, "_started", lambda name: SaidCompiler(count))
    assert missing_parts(["filter"]) == ("filter",)
    compilation = Compilation(["filter"])
    told = []
    while not compilation.poll():
        told.append(compilation.seconds_left)
        now[0] += turn
    assert len(told) == count and told[:2] == [None, None]  # the first turn only starts the process
    for done, left in enumerate(told):
        assert left is None or left == pytest.approx(turn * (count - done))
    assert any(left is not None for left in told)
    assert missing_parts(["filter"]) == () and compilation.share == 1.0 and not compilation.failure


def test_a_part_that_fails_is_told_and_not_taken_as_compiled(
    empty_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def started(name: str) -> subprocess.Popen[bytes]:
        process = subprocess.Popen([sys.executable, "-c", "raise SystemExit(3)"], stdout=subprocess.PIPE, bufsize=0)
        kernels.os.set_blocking(process.stdout.fileno(), False)
        return process

    monkeypatch.setattr(kernels, "_started", started)
    assert re.search(r"kernels of filter .*exit code 3", kernels.compile_ahead(["filter"]))
    assert missing_parts(["filter"]) == ("filter",)


def test_another_copy_of_the_source_compiles_its_own(empty_cache: Path, tmp_path: Path) -> None:
    """numba keeps kernels by the path of their file: the mark that says "complete" must not be taken for another's."""
    root = Path(kernels.__file__).resolve().parents[2]
    for name in ("sgms_observer", "sim_plant"):
        shutil.copytree(root / name, tmp_path / "copy" / name, ignore=shutil.ignore_patterns("__pycache__"))
    jit.note_complete("filter", PARTS["filter"].module)
    assert missing_parts(["filter"]) == ()
    code = "from sgms_observer.application.kernels import missing_parts; print(*missing_parts(['filter']))"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path / "copy"), *sys.path])}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, cwd=tmp_path)
    assert done.stdout.split() == ["filter"], done.stderr
