"""Other solvers on the very windows of the estimator, in the same run."""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter

import numpy as np

from sgms_observer.bench import stages
from sgms_observer.bench.accuracy import converged, newest_force
from sgms_observer.bench.do_mpc_peer import time_do_mpc
from sgms_observer.bench.problem import Problem
from sgms_observer.bench.programme import OPTIONS, ParametricWindow
from sgms_observer.bench.timing import Timing, undisturbed


@dataclass(frozen=True)
class Peer:
    """A peer's time, and how far its answer is from ours.

    Attributes:
        timing: of one call, without building the programme.
        difference: median difference of the friction force: sqpmethod from one real-time iteration of ours, ipopt
            from our converged solution, do-mpc (whose arrival cost is its own) from our estimate [N].
        calls: how many were timed.
    """

    timing: Timing
    difference: float
    calls: int


def time_casadi(problem: Problem) -> dict[str, Peer]:
    """Time sqpmethod, one iteration, and ipopt, converged, from the estimator's warm start in every full window."""
    estimator = problem.estimator()
    windows = {solver: ParametricWindow(problem, estimator, solver) for solver in OPTIONS}
    seconds: dict[str, list[float]] = {solver: [] for solver in OPTIONS}
    differences: dict[str, list[float]] = {solver: [] for solver in OPTIONS}
    with undisturbed():
        for _, is_full in problem.windows(estimator):
            if not is_full:
                stages.improve(estimator.flat)
                continue
            exact = newest_force(converged(estimator.flat))
            answers = {}
            for solver, window in windows.items():
                arguments = window.arguments(estimator)
                start = perf_counter()
                answer = window.solve(arguments)
                seconds[solver].append(perf_counter() - start)
                answers[solver] = window.newest_force(answer)
            stages.improve(estimator.flat)
            differences["sqpmethod"].append(abs(answers["sqpmethod"] - newest_force(estimator.flat)))
            differences["ipopt"].append(abs(answers["ipopt"] - exact))
    return {
        f"casadi_{solver}": Peer(
            Timing.of(seconds[solver]), float(np.median(differences[solver])), len(seconds[solver])
        )
        for solver in OPTIONS
    }


def time_peers(problem: Problem) -> tuple[dict[str, Peer | None], list[str]]:
    """Time every peer.

    Returns:
        Name to result, None for a peer that is not installed; and a sentence for each of those.
    """
    found: dict[str, Peer | None] = dict(time_casadi(problem))
    estimator = problem.estimator()
    ours = []
    for _, is_full in problem.windows(estimator):
        stages.improve(estimator.flat)
        if is_full:
            ours.append(newest_force(estimator.flat))
    try:
        seconds, forces = time_do_mpc(problem, estimator)
    except ImportError:
        found["do_mpc"] = None
        return found, ["do-mpc is not installed, so it is not timed: pip install 'sgms_observer[bench]'"]
    found["do_mpc"] = Peer(Timing.of(seconds), float(np.median(np.abs(np.subtract(forces, ours)))), len(seconds))
    return found, []
