"""The first start after an installation: kernels are compiled in processes of their own, and the node answers."""

from __future__ import annotations

import re
import signal
from pathlib import Path

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


def test_what_is_left_is_estimated_from_what_was_done(empty_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A part's process is replaced by one that says what a compiler says, at a known pace."""
    import subprocess
    import sys
    import time

    monkeypatch.setattr(kernels, "_SOONEST", 0.2)
    code = f"import time\nfor _ in range({PARTS['filter'].functions}): print('.', end='', flush=True); time.sleep(0.05)"

    def started(name: str) -> subprocess.Popen[bytes]:
        process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, bufsize=0)
        kernels.os.set_blocking(process.stdout.fileno(), False)
        return process

    monkeypatch.setattr(kernels, "_started", started)
    assert missing_parts(["filter"]) == ("filter",)
    compilation = Compilation(["filter"])
    begun, told = time.monotonic(), []
    while not compilation.poll():
        if compilation.seconds_left is not None:
            told.append((time.monotonic() - begun, compilation.seconds_left))
        time.sleep(0.02)
    took = time.monotonic() - begun
    middle = [left for now, left in told if 0.4 * took < now < 0.6 * took]
    assert middle and 0.2 * took < sum(middle) / len(middle) < 0.8 * took
    assert missing_parts(["filter"]) == () and compilation.share == 1.0 and not compilation.failure


def test_a_part_that_fails_is_told_and_not_taken_as_compiled(
    empty_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import subprocess
    import sys

    def started(name: str) -> subprocess.Popen[bytes]:
        process = subprocess.Popen([sys.executable, "-c", "raise SystemExit(3)"], stdout=subprocess.PIPE, bufsize=0)
        kernels.os.set_blocking(process.stdout.fileno(), False)
        return process

    monkeypatch.setattr(kernels, "_started", started)
    assert re.search(r"kernels of filter .*exit code 3", kernels.compile_ahead(["filter"]))
    assert missing_parts(["filter"]) == ("filter",)
