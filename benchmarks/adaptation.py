"""Friction that changes in time and place: what estimating it with the state is worth.

    python benchmarks/adaptation.py [--seconds 60] [--json FILE]

First the Coulomb level drifts by 30 % in a minute under the paper's sine; then the table crosses a tight spot (half
as much friction again, 4 mm wide) on a 20 mm move. Both with the compensation in the loop, with p fixed and with
MHE(z, p). Truth is GMS at 10 kHz, 10 nm encoder, 5 nm position noise, 0.1 N force noise. Everything printed is computed
in the run.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from sgms_observer.observer.axis_observer import AxisObserver
from sgms_observer.observer.samples import Estimates
from sgms_observer.settings.axis import AxisSettings, EffectSettings, Settings
from sgms_observer.settings.friction import FrictionSettings
from sgms_observer.settings.observer import CompensationSettings, EstimatorSettings
from sgms_observer.settings.stage import ControllerSettings, EncoderSettings, ReferenceSettings, StageSettings
from sim_plant.closed_loop import ClosedLoop
from sim_plant.record import StageRecord
from sim_plant.table import SimulatedTable

PERIOD = 1.0e-4
DRIFT = 0.3  # share by which the Coulomb level has risen after DRIFT_TIME
DRIFT_TIME = 60.0
BLOCK = 20_000

FIXED = EstimatorSettings(kind="mhe", parameters=())
SLOW = EstimatorSettings(kind="mhe", parameters=("static_force", "coulomb_force"), parameter_walk=1.0e-3)
FAST = EstimatorSettings(kind="mhe", parameters=("static_force", "coulomb_force"), parameter_walk=2.0e-2)


def drifting() -> AxisSettings:
    """Return the paper's sine with a level that rises by 30 % in a minute."""
    share = DRIFT / (1.0 - float(np.exp(-1.0)))
    return _axis(ReferenceSettings(), EffectSettings("thermal_drift", (share, DRIFT_TIME, 0.0, 0.1)))


def tight_spot() -> AxisSettings:
    """Return a 20 mm move over a tight spot in its middle."""
    move = ReferenceSettings(kind="point_to_point", amplitude=0.02, velocity=0.02)
    return _axis(move, EffectSettings("position_dependent_friction", (0.5, 0.01, 0.002)))


def _axis(reference: ReferenceSettings, effect: EffectSettings) -> AxisSettings:
    stage = StageSettings(
        controller=ControllerSettings(feedforward_mass=0.7),
        reference=reference,
        encoder=EncoderSettings(resolution=1.0e-8, noise=5.0e-9),
        force_noise=0.1,
    )
    return AxisSettings(
        stage=stage,
        stage_friction=FrictionSettings(model="gms"),
        stage_effects=(effect,),
        compensation=CompensationSettings(enabled=True, gain=0.9, look_ahead=2.0e-4),
    )


def run(axis: AxisSettings, seconds: float) -> list[tuple[StageRecord, Estimates | None]]:
    """Run stage and observer in the loop; without compensation enabled the observer is left out."""
    table = SimulatedTable(Settings(axes=(axis,), sample_period=PERIOD))
    count = round(seconds / PERIOD)
    blocks: list[tuple[StageRecord, Estimates | None]] = []
    if not axis.compensation.enabled:
        while count > 0:
            blocks.append((table.step(min(count, BLOCK))[0], None))
            count -= BLOCK
        return blocks
    loop = ClosedLoop(table, [AxisObserver(axis, PERIOD).step])
    while count > 0:
        records, estimates = loop.step(min(count, BLOCK))
        blocks.append((records[0], estimates[0]))
        count -= BLOCK
    return blocks


def without_compensation(axis: AxisSettings) -> AxisSettings:
    """Return the axis with compensation off."""
    return replace(axis, compensation=replace(axis.compensation, enabled=False))


def rows_of(
    blocks: list[tuple[StageRecord, Estimates | None]], spans: list[tuple[float, float]]
) -> list[dict[str, float]]:
    """Return tracking error, friction error and estimated level in spans of time."""
    time = np.concatenate([record.time for record, _ in blocks])
    error = np.concatenate([record.position - record.reference_position for record, _ in blocks])
    out = []
    for first, last in spans:
        inside = (time >= first) & (time < last)
        row = {"from": first, "to": last, "tracking_rms": float(np.sqrt(np.mean(error[inside] ** 2)))}
        if blocks[0][1] is not None:
            wrong = np.concatenate([estimates.friction - record.friction for record, estimates in blocks if estimates])
            row["friction_rms"] = float(np.sqrt(np.mean(wrong[inside] ** 2)))
            level = np.concatenate([estimates.parameters for _, estimates in blocks if estimates])
            if level.shape[1]:
                row["coulomb_force"] = float(np.mean(level[inside, -1]))
        out.append(row)
    return out


def compare(
    title: str, axis: AxisSettings, seconds: float, spans: list[tuple[float, float]], adaptive: EstimatorSettings
) -> dict[str, Any]:
    """Print and return one comparison."""
    print(f"\n{title}")
    variants = {
        "no compensation": without_compensation(axis),
        "compensated, p fixed": replace(axis, estimator=FIXED),
        f"compensated, MHE(z, p), walk {adaptive.parameter_walk:g}": replace(axis, estimator=adaptive),
    }
    out: dict[str, Any] = {}
    for label, variant in variants.items():
        rows = rows_of(run(variant, seconds), spans)
        for row in rows:
            text = f"  {label:38s} {row['from']:5.1f}-{row['to']:4.1f} s:"
            text += f" tracking {1e9 * row['tracking_rms']:5.0f} nm rms"
            if "friction_rms" in row:
                text += f", friction error {row['friction_rms']:.3f} N rms"
            if "coulomb_force" in row:
                text += f", mean Coulomb estimate {row['coulomb_force']:.2f} N"
            print(text)
        out[label] = rows
    return out


def main() -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=DRIFT_TIME)
    parser.add_argument("--json", metavar="FILE")
    args = parser.parse_args()
    last = args.seconds
    spans = [(1.0, min(6.0, last)), (0.5 * last, 0.5 * last + 5.0), (max(last - 5.0, 0.0), last)]
    rise = 4.0 * (1.0 + DRIFT / (1.0 - np.exp(-1.0)) * (1.0 - np.exp(-last / DRIFT_TIME)))
    results = {
        "drift": compare(
            f"Coulomb level from 4.0 N to {rise:.2f} N in {last:g} s, sine 200 um 5 Hz", drifting(), last, spans, SLOW
        ),
        "tight spot": compare(
            "tight spot, 4 N to 6 N and back within the move, 20 mm/s", tight_spot(), 5.0, [(1.0, 5.0)], FAST
        ),
    }
    if args.json:
        Path(args.json).write_text(json.dumps(results, indent=1), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
