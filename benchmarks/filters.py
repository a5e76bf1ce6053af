"""How well each filter of block V does: errors of velocity, acceleration and measured friction Y at its own instant.

The stage is simulated at 100 kHz and read at 10 kHz or 1 kHz, with a perfect encoder or one of 10 nm, with even stamps
or with each sample up to 10 % of a period off. Every filter sees the same samples.
Run: ``python benchmarks/filters.py``.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.filters.differentiator import Differentiator
from sgms_observer.filters.motion import LEAD
from sgms_observer.settings.axis import (
    AxisSettings,
    ControllerSettings,
    FilterSettings,
    FrictionSettings,
    ReferenceSettings,
    StageSettings,
)
from sim_plant.record import StageRecord
from sim_plant.stage import SimulatedStage

FINE = 1.0e-5  # s
MASS = 10.0  # kg
DURATION = 0.8  # s
SEED = 7

MOTIONS = {
    "sine 200 um, 5 Hz": ReferenceSettings(kind="sine", amplitude=2.0e-4, frequency=5.0),
    "point to point 5 mm": ReferenceSettings(
        kind="point_to_point", amplitude=5.0e-3, velocity=0.05, acceleration=1.0, jerk=50.0, dwell=0.05
    ),
}

FILTERS = {
    "lowpass 500 Hz, raw effort": FilterSettings(kind="lowpass", cutoff=500.0, align_effort=False),
    "lowpass 500 Hz": FilterSettings(kind="lowpass", cutoff=500.0),
    "lowpass 150 Hz": FilterSettings(kind="lowpass", cutoff=150.0),
    "savgol 0.4 ms": FilterSettings(kind="savgol", window=4.0e-4),
    "savgol 1 ms": FilterSettings(kind="savgol", window=1.0e-3),
    "savgol 2 ms": FilterSettings(kind="savgol", window=2.0e-3),
    "savgol 3 ms": FilterSettings(kind="savgol", window=3.0e-3),
    "savgol 3 ms, degree 5": FilterSettings(kind="savgol", window=3.0e-3, degree=5),
    "savgol 6 ms": FilterSettings(kind="savgol", window=6.0e-3),
    "kalman 3, no lag": FilterSettings(kind="kalman", jerk_density=3.0, lag=0.0),
    "kalman 300, lag 0.3 ms": FilterSettings(kind="kalman", jerk_density=300.0, lag=3.0e-4),
    "kalman 10, lag 1 ms": FilterSettings(kind="kalman", jerk_density=10.0, lag=1.0e-3),
    "kalman 3, lag 1.5 ms": FilterSettings(kind="kalman", jerk_density=3.0, lag=1.5e-3),
    "kalman 1, lag 2 ms": FilterSettings(kind="kalman", jerk_density=1.0, lag=2.0e-3),
}


@dataclass(frozen=True)
class Readings:
    """Samples of one case with the truth behind them on the fine grid.

    Attributes:
        stamp_ns: sample times [ns].
        position: measured [m].
        effort: mean effort from each sample to the next [N].
        fine: the truth.
    """

    stamp_ns: np.ndarray
    position: Floats
    effort: Floats
    fine: StageRecord


def simulate(motion: str) -> StageRecord:
    """Simulate the stage of Table I at 100 kHz."""
    axis = AxisSettings(
        mass=MASS,
        friction=FrictionSettings(model="gms"),
        stage=StageSettings(
            controller=ControllerSettings(bandwidth=100.0, feedforward_mass=1.0), reference=MOTIONS[motion], seed=SEED
        ),
    )
    return SimulatedStage(axis, FINE).step(round(DURATION / FINE) + 1)


def read(fine: StageRecord, period: float, resolution: float, jitter: float) -> Readings:
    """Read the stage as an encoder of ``resolution`` [m] would, each sample up to ``jitter`` periods off."""
    random = np.random.default_rng(SEED)
    every = round(period / FINE)
    index = np.arange(every, len(fine.time) - 3 * every, every)
    index = index + random.integers(-round(jitter * every), round(jitter * every) + 1, len(index))
    position = fine.position[index]
    if resolution > 0.0:
        position = resolution * np.round(position / resolution)
    total = np.concatenate(([0.0], np.cumsum(fine.effort_applied)))
    nexts = np.append(index[1:], index[-1] + every)
    return Readings(fine.stamp_ns[index], position, (total[nexts] - total[index]) / (nexts - index), fine)


def errors(settings: FilterSettings, readings: Readings, period: float) -> tuple[float, float, float, float]:
    """Return rms errors of velocity [m/s], present velocity [m/s], acceleration [m/s^2] and Y [N]."""
    motion = Differentiator(settings, period).step(readings.stamp_ns, readings.position, readings.effort)
    fine = readings.fine
    now = readings.stamp_ns * 1e-9
    claimed = now - motion.table[:, LEAD + motion.delay_samples :].sum(axis=1)
    good = motion.is_ready & (now > 0.1)

    def rms(value: Floats, truth: Floats, at: Floats) -> float:
        error = (value - np.interp(at, fine.time, truth))[good]
        return float(np.sqrt(np.mean(error * error)))

    friction = motion.effort - MASS * motion.acceleration
    return (
        rms(motion.velocity, fine.velocity, claimed),
        rms(motion.present_velocity, fine.velocity, now),
        rms(motion.acceleration, np.gradient(fine.velocity, FINE), claimed),
        rms(friction, fine.friction, claimed),
    )


def main() -> int:
    """Print the tables and the cost of a block."""
    print(f"seed {SEED}; rms errors at the instant each filter claims; v, present v [um/s], a [mm/s^2], Y [mN]")
    for motion in MOTIONS:
        fine = simulate(motion)
        for period in (1.0e-4, 1.0e-3):
            cases = [(0.0, 0.0), (1.0e-8, 0.0), (1.0e-8, 0.1)]
            print(f"\n### {motion}, {1 / period:g} Hz\n")
            print("| filter | delay [ms] | perfect encoder | 10 nm | 10 nm, stamps 10 % off |")
            print("|---|---|---|---|---|")
            for name, settings in FILTERS.items():
                if settings.kind == "lowpass" and settings.cutoff >= 0.5 / period:
                    continue
                entries = []
                for resolution, jitter in cases:
                    v, now_v, a, y = errors(settings, read(fine, period, resolution, jitter), period)
                    entries.append(f"{v * 1e6:.1f}, {now_v * 1e6:.1f}, {a * 1e3:.1f}, {y * 1e3:.1f}")
                delay = Differentiator(settings, period).delay * 1e3
                print(f"| {name} | {delay:.2f} | " + " | ".join(entries) + " |")
    print("\n600,000 samples in blocks of 5000 [s]:")
    for kind in ("lowpass", "savgol", "kalman"):
        print(f"- {kind}: {cost(kind):.3f}")
    return 0


def cost(kind: str) -> float:
    """Return how long 600,000 samples take [s], compilation left out."""
    differentiator = Differentiator(FilterSettings(kind=kind), 1.0e-4)
    stamp_ns = np.arange(600_000, dtype=np.int64) * 100_000
    position, effort = 1e-3 * np.sin(stamp_ns * 1e-8), np.cos(stamp_ns * 1e-8)
    differentiator.step(stamp_ns[:10], position[:10], effort[:10])
    differentiator.reset()
    start = time.perf_counter()
    for k in range(0, len(stamp_ns), 5000):
        differentiator.step(stamp_ns[k : k + 5000], position[k : k + 5000], effort[k : k + 5000])
    return time.perf_counter() - start


if __name__ == "__main__":
    sys.exit(main())
