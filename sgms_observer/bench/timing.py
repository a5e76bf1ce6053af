"""Median and 99th percentile of calls from Python."""

from __future__ import annotations

import gc
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from sgms_observer.bench.problem import PER_INTERVAL, PERIOD, Problem, finish, improve, make_problem, predict, take_in

_GROWTH_WINDOWS = 150


@dataclass(frozen=True)
class Timing:
    """How long a call takes.

    Attributes:
        median: half of the calls took less [us].
        p99: 99 % took less [us].
    """

    median: float
    p99: float

    @classmethod
    def of(cls, seconds: Sequence[float]) -> Timing:
        """Return the figures of many calls; each took so many seconds."""
        median, p99 = np.percentile(seconds, (50.0, 99.0)) * 1e6
        return cls(round(float(median), 3), round(float(p99), 3))


@dataclass(frozen=True)
class EstimatorTimings:
    """The stages of one correction, and the prediction of one sample.

    Attributes:
        predict: EKF prediction with its derivatives.
        iteration: one real-time iteration.
        with_arrival: the same with the window's slide, the arrival cost and the new measurement.
    """

    predict: Timing
    iteration: Timing
    with_arrival: Timing


@contextmanager
def undisturbed() -> Iterator[None]:
    """Keep the garbage collector away."""
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


def time_estimator(problem: Problem, repeats: int = 3) -> EstimatorTimings:
    """Time the stages of every full window, after one pass that is not counted."""
    _pass(problem)
    passes = [_pass(problem) for _ in range(repeats)]
    return EstimatorTimings(*(Timing.of([value for one in passes for value in one[part]]) for part in range(3)))


def _pass(problem: Problem) -> tuple[list[float], list[float], list[float]]:
    """Go through the recording once; return the seconds of predictions, iterations, and iterations with arrival."""
    predictions: list[float] = []
    iterations: list[float] = []
    corrections: list[float] = []
    velocity, acceleration = problem.velocity.tolist(), problem.acceleration.tolist()
    effort = problem.effort.tolist()
    flat = problem.estimator().flat
    with undisturbed():
        for k in range(problem.intervals):
            for i in range(k * PER_INTERVAL, (k + 1) * PER_INTERVAL):
                start = perf_counter()
                predict(flat, velocity[i], PERIOD)
                predictions.append(perf_counter() - start)
            start = perf_counter()
            take_in(flat, effort[i], velocity[i], acceleration[i])
            middle = perf_counter()
            improve(flat)
            end = perf_counter()
            finish(flat)
            if k >= problem.run_in:
                iterations.append(end - middle)
                corrections.append(end - start)
    return predictions, iterations, corrections


def time_growth(values: Sequence[int], name: str) -> list[list[float]]:
    """Time one real-time iteration for several sizes.

    Args:
        values: the sizes.
        name: ``n_z`` or ``horizon``.

    Returns:
        One pair (size, median time [us]) per size.
    """
    pairs = []
    for value in values:
        sizes = {"n_z": value} if name == "n_z" else {"horizon": value}
        problem = make_problem(**sizes, windows=_GROWTH_WINDOWS)
        pairs.append([value, time_estimator(problem, repeats=1).iteration.median])
    return pairs


def slope(pairs: Sequence[Sequence[float]]) -> float:
    """Return the exponent with which the times of ``time_growth`` grow with size: the slope in a log-log plot."""
    size, time = np.log(np.array(pairs, dtype=float)).T
    return round(float(np.polyfit(size, time, 1)[0]), 3)
