"""Real-time iterations against the converged solution of their own window, at the package's own settings."""

import pytest

pytest.importorskip("casadi", reason="CasADi is not installed")

from sgms_observer.bench.accuracy import accuracy
from sgms_observer.bench.problem import make_problem


@pytest.mark.parametrize("seed", [1, 5, 6, 7])  # Gauss-Newton alone misses on the first three, and is slowest on 7
def test_one_and_two_iterations_are_near_the_converged_solution(seed: int) -> None:
    problem = make_problem(seed=seed)
    one, two = accuracy(problem, 1), accuracy(problem, 2)
    assert one.instants == two.instants == 397
    assert one.rms < 5e-3 and two.rms < 1e-4
    assert two.largest < 1e-3
