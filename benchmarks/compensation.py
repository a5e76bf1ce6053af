"""Tracking with and without compensation, beside the peers a user would pick instead, and on random stages.

    python benchmarks/compensation.py [--cases 200] [--processes 1] [--json FILE]

Everything printed is computed in the run. The stage is a GMS plant at 10 kHz with a 10 nm encoder, 5 nm position noise
and 0.1 N force noise; observer and compensation use the nominal S-GMS model. The controller's mass feedforward is the
one that tracks best without friction, so that what is left is friction.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from compensation_peers import CoulombViscous, DisturbanceObserver, LuGre, Peer

from sgms_observer.observer.axis_observer import AxisObserver
from sgms_observer.settings.axis import (
    AxisSettings,
    CompensationSettings,
    ControllerSettings,
    EncoderSettings,
    FrictionSettings,
    ReferenceSettings,
    Settings,
    StageSettings,
)
from sim_plant.record import StageRecord, join_records
from sim_plant.table import SimulatedTable

PERIOD = 1.0e-4
SKIP = 0.3  # s at the start that do not count
REVERSAL_WINDOW = 0.02  # s after the reference turns or departs
REST_WINDOW = 0.08  # s at the end of a dwell
RING_FACTOR, RING_FLOOR = 1.5, 2.0e-9  # rings: rms at rest above this many times that without, plus this [m]

SINE = ReferenceSettings()
POINT_TO_POINT = ReferenceSettings(kind="point_to_point", amplitude=0.02)
DURATION = {"sine": 1.0, "point_to_point": 2.0}
LOOK_AHEAD = 2.0e-4  # one sample until the effort changes, and half of the one it is held


@dataclass(frozen=True)
class Figures:
    """Tracking of one run: rms and reversal peak of the position error, rms of the position at rest [m]."""

    rms: float
    peak: float
    rest: float


def nominal(reference: ReferenceSettings, seed: int = 1) -> AxisSettings:
    """Return the nominal axis: GMS truth, S-GMS model, compensation on."""
    stage = StageSettings(
        controller=ControllerSettings(feedforward_mass=0.7),
        reference=reference,
        encoder=EncoderSettings(resolution=1.0e-8, noise=5.0e-9),
        force_noise=0.1,
        seed=seed,
    )
    return AxisSettings(
        stage=stage,
        stage_friction=FrictionSettings(model="gms"),
        compensation=CompensationSettings(enabled=True, gain=0.9, look_ahead=LOOK_AHEAD),
    )


def run(axis: AxisSettings, duration: float, step: Callable[[StageRecord], float] | None) -> StageRecord:
    """Run the stage, with the compensation of each sample entering the effort of the next."""
    table = SimulatedTable(Settings(axes=(axis,), sample_period=PERIOD))
    count = round(duration / PERIOD)
    if step is None:
        return table.step(count)[0]
    records = []
    compensation = 0.0
    for _ in range(count):
        record = table.step(1, [compensation])[0]
        compensation = step(record)
        records.append(record)
    return join_records(records)


def observed(axis: AxisSettings, has_reference: bool = True) -> Callable[[StageRecord], float]:
    """Return this package's compensation as a step."""
    observer = AxisObserver(axis, PERIOD)
    missing = np.full(1, np.nan)

    def step(record: StageRecord) -> float:
        samples = record.samples
        if not has_reference:
            samples = replace(samples, reference_position=missing, reference_velocity=missing)
        return float(observer.step(samples).compensation[-1])

    return step


def stepped(peer: Peer) -> Callable[[StageRecord], float]:
    """Return a peer as a step."""

    def step(record: StageRecord) -> float:
        return peer.step(
            float(record.measured_position[0]),
            float(record.control_effort[0]),
            float(record.reference_position[0]),
            float(record.reference_velocity[0]),
        )

    return step


def figures(record: StageRecord) -> Figures:
    """Return what a run is judged by."""
    counts = record.time > SKIP
    error = record.position - record.reference_position
    direction = np.sign(record.reference_velocity)
    turns = np.flatnonzero((direction[1:] != direction[:-1]) & (direction[1:] != 0.0)) + 1
    near = np.zeros(len(error), dtype=bool)
    for turn in turns:
        near[turn : turn + round(REVERSAL_WINDOW / PERIOD)] = True
    resting = direction == 0.0
    length = round(REST_WINDOW / PERIOD)
    ends = [end for end in np.flatnonzero(resting[:-1] & ~resting[1:]) if end > SKIP / PERIOD]
    rest = max((float(np.std(record.position[end - length : end])) for end in ends), default=float("nan"))
    return Figures(
        float(np.sqrt(np.mean(error[counts] ** 2))), float(np.max(np.abs(error[near & counts]), initial=0.0)), rest
    )


def best_peer(make: Callable[[float], Peer], settings: tuple[float, ...]) -> tuple[float, Callable[[float], Peer]]:
    """Return the setting with the smallest rms error on the sine: each peer at its best."""
    axis = nominal(SINE)
    scores = {value: figures(run(axis, 0.6, stepped(make(value)))).rms for value in settings}
    return min(scores, key=lambda value: scores[value]), make


def peers_table() -> dict[str, Any]:
    """Print and return the nominal comparison."""
    friction = nominal(SINE).friction
    kappa = sum(friction.element_stiffness)
    coulomb = best_peer(lambda gain: CoulombViscous(friction, gain), (0.6, 0.7, 0.8, 0.9, 1.0))
    lugre_stiffness = best_peer(
        lambda share: LuGre(friction, 0.9, share * kappa, PERIOD), (0.05, 0.1, 0.2, 0.4, 0.7, 1.0)
    )[0]
    lugre = best_peer(lambda gain: LuGre(friction, gain, lugre_stiffness * kappa, PERIOD), (0.7, 0.8, 0.9, 1.0))
    observer = best_peer(lambda corner: DisturbanceObserver(10.0, corner, PERIOD), (10.0, 20.0, 40.0, 80.0, 160.0))
    out: dict[str, Any] = {}
    for name, reference in (("sine 200 um 5 Hz", SINE), ("point to point 20 mm with dwells", POINT_TO_POINT)):
        axis = nominal(reference)
        full_gain = replace(axis, compensation=replace(axis.compensation, gain=1.0))
        duration = DURATION[reference.kind]
        without = figures(run(axis, duration, None))
        rows = {
            "no compensation": without,
            f"static Coulomb + viscous, gain {coulomb[0]:g}": figures(
                run(axis, duration, stepped(coulomb[1](coulomb[0])))
            ),
            f"LuGre, gain {lugre[0]:g}, stiffness {lugre_stiffness:g} sum kappa": figures(
                run(axis, duration, stepped(lugre[1](lugre[0])))
            ),
            f"disturbance observer, {observer[0]:g} Hz": figures(
                run(axis, duration, stepped(observer[1](observer[0])))
            ),
            "sgms_observer, gain 0.9 (default)": figures(run(axis, duration, observed(axis))),
            "sgms_observer, gain 1": figures(run(full_gain, duration, observed(full_gain))),
            "sgms_observer, gain 0.9, no reference published": figures(run(axis, duration, observed(axis, False))),
        }
        print(f"\n{name}")
        print(f"  {'':52s} {'rms':>9s} {'x less':>7s} {'reversal':>10s} {'x less':>7s} {'at rest':>9s}")
        for label, row in rows.items():
            print(
                f"  {label:52s} {1e9 * row.rms:6.0f} nm {without.rms / row.rms:7.1f} {1e9 * row.peak:7.0f} nm"
                f" {without.peak / row.peak:7.1f} {1e9 * row.rest:6.1f} nm"
            )
        out[name] = {label: vars(row) for label, row in rows.items()}
    return out


def delay_table() -> dict[str, Any]:
    """Print and return what bridging an actuation delay is worth."""
    print("\nsine, 0.3 ms from output to force")
    out: dict[str, Any] = {}
    base = nominal(SINE)
    stage = replace(base.stage, actuation_delay=3.0e-4, controller=replace(base.stage.controller, bandwidth=70.0))
    without = figures(run(replace(base, stage=stage), 1.0, None))
    for look_ahead in (0.0, LOOK_AHEAD, LOOK_AHEAD + 3.0e-4):
        axis = replace(base, stage=stage, compensation=replace(base.compensation, look_ahead=look_ahead))
        row = figures(run(axis, 1.0, observed(axis)))
        print(
            f"  look_ahead {1e3 * look_ahead:.1f} ms: rms {1e9 * row.rms:.0f} nm,"
            f" {without.rms / row.rms:.1f} times less; reversal {1e9 * row.peak:.0f} nm,"
            f" {without.peak / row.peak:.1f} times less"
        )
        out[f"{look_ahead:g}"] = vars(row)
    return out


def random_axis(case: int, reference: ReferenceSettings) -> AxisSettings:
    """Return a stage whose friction, mass, stiffness and bandwidth are not those of the model."""
    rng = np.random.default_rng([case, 2026])
    base = nominal(reference, seed=case + 1)
    nominal_friction = FrictionSettings()
    coulomb = nominal_friction.coulomb_force * rng.uniform(0.8, 1.2)
    friction = replace(
        nominal_friction,
        model=("gms", "sgms")[case % 2],
        coulomb_force=coulomb,
        static_force=coulomb * rng.uniform(1.0, 1.3),
        stribeck_velocity=nominal_friction.stribeck_velocity * 2.0 ** rng.uniform(-1.0, 1.0),
        viscous_coefficient=nominal_friction.viscous_coefficient * rng.uniform(0.8, 1.2),
        element_stiffness=tuple(np.array(nominal_friction.element_stiffness) * rng.uniform(0.8, 1.2)),
    )
    controller = replace(base.stage.controller, bandwidth=rng.uniform(50.0, 150.0))
    stage = replace(base.stage, mass=base.mass * rng.uniform(0.8, 1.2), controller=controller)
    return replace(base, stage=stage, stage_friction=friction)


def random_case(case: int, gain: float) -> dict[str, Any]:
    """Return the figures of one random stage, both references."""
    out: dict[str, Any] = {"case": case}
    for reference, duration in ((SINE, 0.7), (POINT_TO_POINT, 1.3)):
        axis = random_axis(case, reference)
        axis = replace(axis, compensation=replace(axis.compensation, gain=gain))
        without, compensated = figures(run(axis, duration, None)), figures(run(axis, duration, observed(axis)))
        out[reference.kind] = {"without": vars(without), "with": vars(compensated)}
    return out


def random_table(cases: int, processes: int, gain: float) -> dict[str, Any]:
    """Print and return how often compensation makes it worse or rings, over random stages."""
    if processes > 1:
        with ProcessPoolExecutor(processes) as pool:
            rows = list(pool.map(random_case, range(cases), [gain] * cases))
    else:
        rows = [random_case(case, gain) for case in range(cases)]
    print(
        f"\n{cases} random stages (seeds 0 to {cases - 1}), gain {gain:g}: friction, kappa and mass +-20 %, bandwidth"
        " 50 to 150 Hz"
    )
    worse, ringing = set(), set()
    for kind in ("sine", "point_to_point"):
        ratios = np.array([row[kind]["without"]["rms"] / row[kind]["with"]["rms"] for row in rows])
        peaks = np.array([row[kind]["without"]["peak"] / row[kind]["with"]["peak"] for row in rows])
        worse |= {row["case"] for row, ratio in zip(rows, ratios, strict=True) if ratio < 1.0}
        print(
            f"  {kind:15s} rms {np.min(ratios):.1f} to {np.max(ratios):.1f} times less, median {np.median(ratios):.1f};"
            f" reversal peak {np.min(peaks):.1f} to {np.max(peaks):.1f}, median {np.median(peaks):.1f}"
        )
    rests = [(row["point_to_point"]["without"]["rest"], row["point_to_point"]["with"]["rest"]) for row in rows]
    ringing = {row["case"] for row, (a, b) in zip(rows, rests, strict=True) if not b <= RING_FACTOR * a + RING_FLOOR}
    print(
        f"  rms at rest {1e9 * max(b for _, b in rests):.1f} nm at most with compensation,"
        f" {1e9 * max(a for a, _ in rests):.1f} nm without"
    )
    print(f"  cases made worse: {len(worse)} {sorted(worse)}; cases ringing at rest: {len(ringing)} {sorted(ringing)}")
    return {"worse": sorted(worse), "ringing": sorted(ringing), "cases": rows}


def main() -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=200)
    parser.add_argument("--gain", type=float, default=0.9, help="of the random stages")
    parser.add_argument("--random-only", action="store_true", help="leave the comparison with peers out")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--json", metavar="FILE")
    args = parser.parse_args()
    results = {} if args.random_only else {"nominal": peers_table(), "delay": delay_table()}
    if args.cases:
        results["random"] = random_table(args.cases, args.processes, args.gain)
    if args.json:
        Path(args.json).write_text(json.dumps(results, indent=1), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
