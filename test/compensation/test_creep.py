"""Motion slower than noise lets an estimated velocity tell: with compensation rms and peak error are never larger."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from sgms_observer.arrays import Floats
from sgms_observer.compensation.feedforward_kernel import standstill_velocity
from sgms_observer.filters.differentiator import Differentiator
from sgms_observer.observer.axis_observer import AxisObserver
from sgms_observer.observer.samples import Samples
from sgms_observer.settings.axis import AxisSettings, FilterSettings
from sgms_observer.settings.load import load_settings
from sim_plant.stage import SimulatedStage

See = Callable[[Samples], Samples]

CONFIG = Path(__file__).parents[2] / "config"
PERIOD = 1.0e-3
SETTLE = 0.3  # s
SPEEDS = (1.0e-6, 5.0e-6, 2.0e-5, 5.0e-5)  # m/s
COUNT = 88.0e-6  # m


@dataclass(frozen=True)
class Errors:
    """Tracking errors without and with compensation."""

    rms: tuple[float, float]
    peak: tuple[float, float]

    def times(self) -> tuple[float, float]:
        """Return how many times smaller rms and peak are with compensation."""
        return self.rms[0] / self.rms[1], self.peak[0] / self.peak[1]


def _as_published(samples: Samples) -> Samples:
    return samples


def _without_velocity(samples: Samples) -> Samples:
    """Round the set-point to 100 nm and leave its velocity out."""
    rounded = 1.0e-7 * np.round(samples.reference_position / 1.0e-7)
    return replace(samples, reference_position=rounded, reference_velocity=np.full(1, math.nan))


def _without_reference(samples: Samples) -> Samples:
    missing = np.full(1, math.nan)
    return replace(samples, reference_position=missing, reference_velocity=missing)


def _axis(name: str, period: float = PERIOD) -> AxisSettings:
    """Return the first axis of a shipped file at another rate, with its compensation on."""
    axis = load_settings(CONFIG / name).axes[0]
    window = max(axis.filter.window, 9.0 * period)
    return replace(
        axis,
        filter=replace(axis.filter, window=window),
        estimator=replace(axis.estimator, correction_every=2),
        compensation=replace(axis.compensation, enabled=True, standstill_velocity=0.0, look_ahead=1.5 * period),
    )


def _along(
    axis: AxisSettings, time: Floats, position: Floats, folder: Path, interpolation: str = "linear"
) -> AxisSettings:
    """Return the axis whose stage follows a reference."""
    file = folder / "reference.csv"
    np.savetxt(file, np.column_stack([time, position]), delimiter=",", header="time,position", comments="", fmt="%.12g")
    reference = replace(axis.stage.reference, kind="file", file=str(file), interpolation=interpolation)
    return replace(axis, stage=replace(axis.stage, reference=reference))


def _to_and_fro(speed: float, longest: float = 3.0, travel: float = 1.5e-5) -> tuple[Floats, Floats]:
    """Return time and position of a rest, two triangles and a rest, reversing within ``longest`` [s]."""
    leg = min(travel / speed, longest)
    corners = np.cumsum([0.0, 0.5, leg, leg, leg, leg, 0.3])
    places = speed * leg * np.array([0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0])
    return corners, places


def _compared(axis: AxisSettings, seconds: float, see: See = _as_published) -> Errors:
    """Run the stage without and with the observer in the loop."""
    count, first = round(seconds / PERIOD), round(SETTLE / PERIOD)
    observer = AxisObserver(axis, PERIOD)
    plain = SimulatedStage(axis, PERIOD, 10**9).step(count)
    record, _ = SimulatedStage(axis, PERIOD, 10**9).step_answered(
        count, lambda samples: float(observer.step(see(samples)).compensation[-1])
    )
    errors = [(one.position - one.reference_position)[first:] for one in (plain, record)]
    rms = [float(np.sqrt(np.mean(error**2))) for error in errors]
    peak = [float(np.max(np.abs(error))) for error in errors]
    return Errors((rms[0], rms[1]), (peak[0], peak[1]))


def _excitation() -> tuple[Floats, Floats]:
    """Return a motion that shows friction: reversals from 100 nm to 0.3 mm, traverses from 10 um/s to 10 mm/s."""
    turn = 0.5 * (1.0 - np.cos(2.0 * np.pi * np.arange(500) * PERIOD / 0.5))
    parts = [np.zeros(500)]
    parts += [np.tile(size * turn, 3) for size in np.geomspace(1.0e-7, 3.0e-4, 8)]
    rise = 0.5 * (1.0 - np.cos(np.pi * np.arange(50) / 50.0))
    ramp = np.concatenate([rise, np.ones(900), rise[::-1]])
    for speed in np.geomspace(1.0e-5, 1.0e-2, 6):
        parts += [speed * PERIOD * np.cumsum(np.concatenate([ramp, -ramp]))]
    position = np.concatenate(parts)
    return PERIOD * np.arange(len(position)), position


def test_eight_times_less_error_on_a_motion_that_shows_friction(tmp_path: Path) -> None:
    time, position = _excitation()
    assert np.mean(np.abs(np.diff(position)) < 2.0e-5 * PERIOD) > 0.3
    rms, peak = _compared(
        _along(_axis("compensation.yaml"), time, position, tmp_path, "cubic"), float(time[-1])
    ).times()
    assert rms > 8.0 and peak > 4.0, (rms, peak)


@pytest.mark.parametrize("see", [_as_published, _without_velocity])
@pytest.mark.parametrize("speed", SPEEDS)
def test_creep_with_reversals(speed: float, see: See, tmp_path: Path) -> None:
    time, position = _to_and_fro(speed)
    rms, peak = _compared(_along(_axis("compensation.yaml"), time, position, tmp_path), float(time[-1]), see).times()
    assert rms > 5.0 and peak > 3.0, (rms, peak)


@pytest.mark.parametrize("speed", [*SPEEDS, None])
def test_the_demo_stage(speed: float | None, tmp_path: Path) -> None:
    """On creep, and on its own sine (None); its stiffness is 20 % too low."""
    axis = _axis("demo.yaml")
    if speed is None:
        errors = _compared(axis, 2.0)
    else:
        time, position = _to_and_fro(speed)
        errors = _compared(_along(axis, time, position, tmp_path), float(time[-1]))
    rms, peak = errors.times()
    assert rms > 2.0 and peak > 2.0, (rms, peak)


@pytest.mark.parametrize("speed", [1.0e-5, 1.0e-3])
def test_a_revolute_joint(speed: float, tmp_path: Path) -> None:
    time, position = _to_and_fro(speed, travel=2.0e-3)
    rms, peak = _compared(_along(_axis("joint.yaml"), time, position, tmp_path), float(time[-1])).times()
    assert rms > 1.5 and peak > 1.2, (rms, peak)


@pytest.mark.parametrize("speed", [2.0e-5, 5.0e-5])
def test_an_encoder_of_88_um(speed: float, tmp_path: Path) -> None:
    """Without integral action; with it the loop hunts by counts, without compensation and with it."""
    axis = _axis("compensation.yaml")
    controller = replace(axis.stage.controller, bandwidth=5.0)
    encoder = replace(axis.stage.encoder, resolution=COUNT, noise=0.0)
    axis = replace(
        axis,
        filter=replace(axis.filter, window=50.0e-3, position_noise=COUNT / math.sqrt(12.0)),
        stage=replace(axis.stage, controller=controller, encoder=encoder),
    )
    time, position = _to_and_fro(speed, longest=6.0, travel=5.0e-4)
    rms, peak = _compared(_along(axis, time, position, tmp_path), float(time[-1])).times()
    assert rms > 1.5 and peak > 1.2, (rms, peak)


@pytest.mark.parametrize("back", [2.0e-6, 1.0e-5])
def test_without_a_reference_a_force_that_the_friction_contradicts_is_let_go(back: float, tmp_path: Path) -> None:
    """A fast move, then so slowly back that the velocity does not tell."""
    time = np.array([0.0, 0.5, 1.0, 1.2, 3.2, 3.4])
    position = np.array([0.0, 0.0, 1.0e-3, 1.0e-3, 1.0e-3 - 2.0 * back, 1.0e-3 - 2.0 * back])
    axis = _along(_axis("compensation.yaml"), time, position, tmp_path)
    assert back < standstill_velocity(axis.filter, PERIOD)
    errors = _compared(axis, float(time[-1]), _without_reference)
    assert errors.rms[1] <= errors.rms[0] and errors.peak[1] <= errors.peak[0], errors


@pytest.mark.parametrize("kind", ["lowpass", "savgol", "kalman"])
def test_the_standstill_velocity_is_three_deviations_of_a_resting_velocity(kind: str) -> None:
    settings = FilterSettings(kind=kind, window=9.0e-3, position_noise=2.0e-8, cutoff=100.0)
    noise = np.random.default_rng(3).normal(0.0, settings.position_noise, 40_000)
    stamp_ns = np.arange(len(noise)) * round(PERIOD * 1e9)
    velocity = Differentiator(settings, PERIOD).step(stamp_ns, noise, np.zeros(len(noise))).present_velocity[2000:]
    assert standstill_velocity(settings, PERIOD) == pytest.approx(3.0 * float(np.std(velocity)), rel=0.05)
