"""Friction that changes in time and place: what estimating it with the state is worth.

    python benchmarks/adaptation.py [--seconds 60] [--json FILE] [--picture PNG]

First the Coulomb level drifts by 30 % in a minute under the paper's sine; then the table crosses a tight spot (half
as much friction again, 4 mm wide) on a 20 mm move. Both with the compensation in the loop, with p fixed and with
MHE(z, p). Truth is GMS at 10 kHz, 10 nm encoder, 5 nm position noise, 0.1 N force noise. Everything printed is computed
in the run.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from sgms_observer.arrays import Floats
from sgms_observer.effects.compiled import CompiledEffects
from sgms_observer.observer.axis_observer import AxisObserver
from sgms_observer.observer.samples import Estimates
from sgms_observer.report.drawing import ESTIMATE, MEASURED, REFERENCE, TRUTH, sheet
from sgms_observer.settings.axis import (
    AxisSettings,
    CompensationSettings,
    ControllerSettings,
    EffectSettings,
    EncoderSettings,
    EstimatorSettings,
    FrictionSettings,
    ReferenceSettings,
    Settings,
    StageSettings,
)
from sim_plant.closed_loop import ClosedLoop
from sim_plant.record import StageRecord
from sim_plant.table import SimulatedTable

PERIOD = 1.0e-4
DRIFT = 0.3  # share by which the Coulomb level has risen after DRIFT_TIME
DRIFT_TIME = 60.0
BLOCK = 20_000
WITHOUT, FIXED_P = "no compensation", "compensated, p fixed"

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


@dataclass(frozen=True)
class Series:
    """One run over time; every array of shape (n,).

    Attributes:
        time: [s].
        position: [m].
        error: position minus reference [m].
        true_level: Coulomb level of the stage [N].
        level: estimated Coulomb level [N]; empty where it is not estimated.
        wrong: estimated minus true friction [N]; empty without an observer.
    """

    time: Floats
    position: Floats
    error: Floats
    true_level: Floats
    level: Floats
    wrong: Floats

    @classmethod
    def of(cls, axis: AxisSettings, seconds: float) -> Series:
        """Run an axis and keep what is shown of it."""
        blocks = run(axis, seconds)
        whole = StageRecord(
            *(np.concatenate([getattr(record, field.name) for record, _ in blocks]) for field in fields(StageRecord))
        )
        observed = [(record, estimates) for record, estimates in blocks if estimates is not None]
        wrong = [estimates.friction - record.friction for record, estimates in observed]
        level = [estimates.parameters[:, -1] for _, estimates in observed if estimates.parameters.shape[1]]
        nothing = [np.zeros(0)]
        return cls(
            whole.time,
            whole.position,
            whole.position - whole.reference_position,
            axis.stage_friction.coulomb_force * _true_factor(axis.stage_effects[0], whole),
            np.concatenate(level or nothing),
            np.concatenate(wrong or nothing),
        )

    def row(self, first: float, last: float) -> dict[str, float]:
        """Return tracking error, friction error and estimated level in a span of time."""
        inside = (self.time >= first) & (self.time < last)
        row = {"from": first, "to": last, "tracking_rms": float(np.sqrt(np.mean(self.error[inside] ** 2)))}
        if self.wrong.size:
            row["friction_rms"] = float(np.sqrt(np.mean(self.wrong[inside] ** 2)))
        if self.level.size:
            row["coulomb_force"] = float(np.mean(self.level[inside]))
        return row


def _true_factor(hidden: EffectSettings, record: StageRecord) -> Floats:
    """Return the hidden effect's factor on the Coulomb level along the true motion."""
    effects = CompiledEffects((hidden,), PERIOD)
    n = len(record.time)
    return effects.evaluate(
        record.position, record.velocity, record.acceleration, record.time, record.effort_applied,
        np.full(n, PERIOD), np.ones(n), effects.initial_state(),
    )[1]  # fmt: skip


def compare(
    title: str, axis: AxisSettings, seconds: float, spans: list[tuple[float, float]], adaptive: EstimatorSettings
) -> tuple[dict[str, Any], dict[str, Series]]:
    """Print and return one comparison."""
    print(f"\n{title}")
    variants = {
        WITHOUT: without_compensation(axis),
        FIXED_P: replace(axis, estimator=FIXED),
        f"compensated, MHE(z, p), walk {adaptive.parameter_walk:g}": replace(axis, estimator=adaptive),
    }
    out: dict[str, Any] = {}
    series: dict[str, Series] = {}
    for label, variant in variants.items():
        series[label] = Series.of(variant, seconds)
        out[label] = [series[label].row(*span) for span in spans]
        for row in out[label]:
            text = f"  {label:38s} {row['from']:5.1f}-{row['to']:4.1f} s:"
            text += f" tracking {1e9 * row['tracking_rms']:5.0f} nm rms"
            if "friction_rms" in row:
                text += f", friction error {row['friction_rms']:.3f} N rms"
            if "coulomb_force" in row:
                text += f", mean Coulomb estimate {row['coulomb_force']:.2f} N"
            print(text)
    return out, series


def picture(drift: Mapping[str, Series], spot: Mapping[str, Series]) -> bytes:
    """Draw the levels, true and estimated, and the tracking errors; PNG."""
    colours = (REFERENCE, MEASURED, ESTIMATE)
    caption = "Friction that changes in time and place."
    with sheet("adaptation", caption, rows=2, columns=2, height=2.6) as drawn:
        level, tracking, place, errors = drawn.axes
        for (label, series), colour in zip(drift.items(), colours, strict=True):
            every = round(1.0 / PERIOD)
            seconds = len(series.error) // every
            rms = np.sqrt(np.mean(series.error[: seconds * every].reshape(seconds, every) ** 2, axis=1))
            tracking.plot(0.5 + np.arange(seconds), 1e9 * rms, color=colour, label=label)
            if series.level.size:
                level.plot(series.time[::every], series.true_level[::every], color=TRUTH, label="true")
                level.plot(series.time[::every], series.level[::every], color=colour, label="estimated")
        for (label, series), colour in zip(spot.items(), colours, strict=True):
            late = series.time > 1.0
            errors.plot(series.time[late], 1e6 * series.error[late], color=colour, lw=0.6, label=label)
            if series.level.size:
                place.plot(1e3 * series.position[late], series.level[late], color=colour, lw=0.6, label="estimated")
                place.plot(1e3 * series.position[late], series.true_level[late], ".", color=TRUTH, ms=1, label="true")
        level.set(xlabel="time [s]", ylabel="Coulomb level [N]", title="level drifts")
        tracking.set(xlabel="time [s]", ylabel="tracking [nm rms]", ylim=(0.0, None), title="level drifts")
        place.set(xlabel="position [mm]", ylabel="Coulomb level [N]", title="tight spot")
        errors.set(xlabel="time [s]", ylabel="tracking error [um]", title="tight spot")
        for axes in (level, tracking, place):
            axes.legend(fontsize=8)
    assert drawn.picture is not None
    return drawn.picture.png


def main() -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=DRIFT_TIME)
    parser.add_argument("--json", metavar="FILE")
    parser.add_argument("--picture", metavar="PNG", help="draw levels and tracking errors")
    args = parser.parse_args()
    last = args.seconds
    spans = [(1.0, min(6.0, last)), (0.5 * last, 0.5 * last + 5.0), (max(last - 5.0, 0.0), last)]
    rise = 4.0 * (1.0 + DRIFT / (1.0 - np.exp(-1.0)) * (1.0 - np.exp(-last / DRIFT_TIME)))
    drift, drift_series = compare(
        f"Coulomb level from 4.0 N to {rise:.2f} N in {last:g} s, sine 200 um 5 Hz", drifting(), last, spans, SLOW
    )
    spot, spot_series = compare(
        "tight spot, 4 N to 6 N and back within the move, 20 mm/s", tight_spot(), 5.0, [(1.0, 5.0)], FAST
    )
    results = {"drift": drift, "tight spot": spot}
    if args.json:
        Path(args.json).write_text(json.dumps(results, indent=1), encoding="utf-8")
    if args.picture:
        Path(args.picture).write_bytes(picture(drift_series, spot_series))
    return 0


if __name__ == "__main__":
    sys.exit(main())
