"""benchmarks/demo_runs.py: figures from each run's result.json, and runs that fail are not left out."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import pytest
from program import load_script

demo_runs = load_script("benchmarks/demo_runs.py")


def _axis(peak_after: float, late: float | None) -> dict[str, Any]:
    tracking = {"rms_before": 3e-6, "rms_after": 3e-7, "peak_before": 4e-6, "peak_after": peak_after}
    return {"tracking": tracking, "late_share": late}


@pytest.fixture
def runs(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[tuple[int, dict[str, Any]]]:
    """Return a list of exit codes and results of the demonstrations to come."""
    planned: list[tuple[int, dict[str, Any]]] = []
    caches = set()

    def demonstrated(command: list[str], env: dict[str, str], **_: Any) -> Any:
        caches.add(env["XDG_CACHE_HOME"])
        assert len(caches) == 1 and Path(caches.copy().pop()).is_relative_to(tmp_path)
        code, axis = planned.pop(0)
        folder = Path(command[command.index("--out") + 1])
        (folder / "result.json").write_text(json.dumps({"axes": {"x": axis}}))
        return type("Done", (), {"returncode": code})

    monkeypatch.setattr(demo_runs.subprocess, "run", demonstrated)
    monkeypatch.setattr(sys, "argv", ["demo_runs.py", "--runs", "3", "--out", str(tmp_path / "out")])
    return planned


def test_the_first_run_is_compared_with_the_later_ones(
    runs: list[tuple[int, dict[str, Any]]], capsys: pytest.CaptureFixture[str]
) -> None:
    runs += [(0, _axis(5e-6, 0.1)), (0, _axis(1e-6, 0.0)), (0, _axis(8e-7, None))]
    assert demo_runs.main() == 0
    lines = capsys.readouterr().out.splitlines()
    assert "10 %" in lines[2] and "0.80x" in lines[2] and "10.00x" in lines[2]
    assert "0 %" in lines[3] and "4.00x" in lines[3]
    assert "-" in lines[4] and "5.00x" in lines[4]
    assert "first run 0.80x, later runs 4.00x to 5.00x; the first is better than 0 of 2 later runs" in lines[5]


def test_a_run_that_fails_is_told(
    runs: list[tuple[int, dict[str, Any]]], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    runs += [(0, _axis(1e-6, 0.0)), (1, _axis(1e-6, 0.0)), (0, _axis(1e-6, 0.0))]
    assert demo_runs.main() == 1
    assert "1 of 3 runs failed" in capsys.readouterr().out
    with pytest.raises(SystemExit):  # kernels of an earlier call may be there
        demo_runs.main()
