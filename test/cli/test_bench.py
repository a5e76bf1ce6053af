"""``sgms bench``: its JSON, the right answers behind its times, peers that agree, and peers that are missing."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("casadi", reason="CasADi is not installed")

from sgms_observer.bench import timing
from sgms_observer.bench.accuracy import accuracy, converged, newest_force
from sgms_observer.bench.peers import time_casadi, time_peers
from sgms_observer.bench.problem import improve, make_problem
from sgms_observer.bench.process import run_python, seconds_used
from sgms_observer.bench.timing import Timing, slope, time_estimator
from sgms_observer.cli.main import main
from sgms_observer.errors import DataError

WINDOWS = 30


def test_json_has_the_promised_shape(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(timing, "_GROWTH_WINDOWS", 12)
    file = tmp_path / "bench.json"
    parts = ["speed", "accuracy", "growth"]
    arguments = ["bench", "--windows", "12", "--json", str(file), "--out", str(tmp_path / "pictures"), "--only", *parts]
    assert main(arguments) == 0
    result = json.loads(file.read_text())
    for name in ("mhe_rti_us", "mhe_rti_with_arrival_us", "ekf_predict_us"):
        assert 0.0 < result[name]["median"] <= result[name]["p99"]
    assert result["peers_us"] == {"do_mpc": None, "casadi_sqpmethod": None, "casadi_ipopt": None}
    assert set(result["force_error_rms_n"]) >= {"one_iteration", "two_iterations"}
    assert [size for size, _ in result["growth"]["n_z"]] == [2, 4, 8, 16, 32]
    assert [size for size, _ in result["growth"]["horizon"]] == [2, 4, 8, 16, 32, 64, 128]
    assert "cores" in result["machine"]
    wrote, *pictures = capsys.readouterr().out.splitlines()
    assert wrote == f"wrote {file}"
    assert [Path(picture).name for picture in pictures] == ["growth.png", "peers.png"]
    assert all(Path(picture).read_bytes().startswith(b"\x89PNG") for picture in pictures)


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        (["--windows", "0"], "--windows"),
        (["--live-seconds", "nan"], "--live-seconds"),
        (["--publish-every", "0"], "--pu"),
    ],
)
def test_impossible_arguments_are_one_sentence(
    arguments: list[str], name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["bench", *arguments]) == 1
    said = capsys.readouterr().err.strip()
    assert said.startswith(name) and len(said.splitlines()) == 1


def test_one_and_two_iterations_are_as_near_as_required() -> None:
    """5 mN and 0.1 mN rms of the converged solution, which is ipopt's on the formulas."""
    one = accuracy(make_problem(windows=60), 1, ipopt_every=20)
    two = accuracy(make_problem(windows=60), 2)
    assert one.instants == two.instants == 60
    assert two.rms < one.rms <= 5e-3
    assert two.rms <= 1e-4
    assert one.ipopt_instants == 3
    assert one.ipopt_largest <= 1e-8


def test_peers_solve_the_same_problem() -> None:
    """One iteration of sqpmethod is one of ours; converged ipopt is our converged solution."""
    peers = time_casadi(make_problem(windows=WINDOWS))
    assert peers["casadi_sqpmethod"].difference <= 1e-9
    assert peers["casadi_ipopt"].difference <= 1e-6
    assert peers["casadi_ipopt"].calls == WINDOWS


def test_a_missing_peer_is_said_and_left_empty(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "do_mpc", None)
    found, sentences = time_peers(make_problem(windows=2))
    assert found["do_mpc"] is None
    assert len(sentences) == 1 and "pip install" in sentences[0]


def test_converging_leaves_the_estimator_as_it_is() -> None:
    problem = make_problem(windows=3)
    estimator = problem.estimator()
    for _ in problem.windows(estimator):
        before = estimator.flat.copy()
        exact = converged(estimator.flat)
        np.testing.assert_array_equal(estimator.flat, before)
        improve(exact)
        assert abs(newest_force(converged(exact)) - newest_force(exact)) < 1e-6
        improve(estimator.flat)


def test_timed_windows_are_full_and_counted() -> None:
    problem = make_problem(horizon=6, windows=5)
    full = [is_full for _, is_full in problem.windows(problem.estimator())]
    assert sum(full) == 5
    assert problem.run_in >= 6
    times = time_estimator(replace(problem), repeats=1)
    assert times.with_arrival.median >= times.iteration.median > 0.0


def test_percentiles_and_slope() -> None:
    assert Timing.of([1e-6] * 99 + [1e-3]).median == 1.0
    assert slope([[size, 3.0 * size**1.5] for size in (2, 4, 8)]) == pytest.approx(1.5, abs=1e-3)


def test_a_process_that_fails_is_one_sentence() -> None:
    with pytest.raises(DataError, match="no such thing"):
        run_python(["-c", "import sys; sys.exit('no such thing')"])
    assert "42" in run_python(["-c", "print(42)"]).output
    assert seconds_used(1) >= 0.0
