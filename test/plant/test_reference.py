"""References: derivatives belong together, limits hold, files are read and repeat."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sgms_observer.errors import ConfigurationError
from sgms_observer.settings.axis import ReferenceSettings
from sim_plant.reference import Reference, make_reference

LIMITS = {"velocity": 0.05, "acceleration": 1.0, "jerk": 50.0}


def assert_derivatives(reference: Reference, until: float, scale: tuple[float, float]) -> None:
    step = 1e-6
    time = np.linspace(step, until, 997)
    position, velocity, _ = reference.at(time + step)
    before, velocity_before, _ = reference.at(time - step)
    _, middle, acceleration = reference.at(time)
    np.testing.assert_allclose((position - before) / (2 * step), middle, atol=1e-5 * scale[0])
    np.testing.assert_allclose((velocity - velocity_before) / (2 * step), acceleration, atol=1e-3 * scale[1])


def test_papers_sine() -> None:
    reference = make_reference(ReferenceSettings())
    position, velocity, acceleration = reference.at(np.array([0.0, 0.05, 0.1]))
    np.testing.assert_allclose(position, [0.0, 2e-4, 0.0], atol=1e-18)
    np.testing.assert_allclose(velocity, np.array([1.0, 0.0, -1.0]) * 2e-4 * 10 * np.pi, atol=1e-15)
    np.testing.assert_allclose(acceleration, [0.0, -2e-4 * (10 * np.pi) ** 2, 0.0], atol=1e-14)
    assert_derivatives(reference, 1.0, (6e-3, 0.2))


def test_multi_sine_is_the_sum_of_its_sines() -> None:
    settings = ReferenceSettings(
        kind="multi_sine", amplitudes=(1e-4, 5e-5), frequencies=(3.0, 11.0), phases=(0.3, -1.0)
    )
    reference = make_reference(settings)
    time = np.linspace(0.0, 1.0, 50)
    expected = 1e-4 * np.sin(6 * np.pi * time + 0.3) + 5e-5 * np.sin(22 * np.pi * time - 1.0)
    np.testing.assert_allclose(reference.at(time)[0], expected, atol=1e-18)
    assert_derivatives(reference, 1.0, (6e-3, 0.3))


@pytest.mark.parametrize("fault", [{"amplitudes": (1e-4,)}, {"amplitudes": ()}, {"phases": (0.0, 0.0, 0.0)}])
def test_multi_sine_says_when_its_lists_do_not_match(fault: dict[str, tuple[float, ...]]) -> None:
    settings = ReferenceSettings(kind="multi_sine", amplitudes=(1e-4, 1e-4), frequencies=(1.0, 2.0))
    with pytest.raises(ConfigurationError, match=r"y\.stage\.reference of kind multi_sine has"):
        make_reference(replace(settings, **fault), "y")


@given(
    stroke=st.floats(1e-7, 1.0), velocity=st.floats(1e-4, 1.0), acceleration=st.floats(1e-2, 50.0),
    jerk=st.floats(1.0, 1e4), dwell=st.floats(0.0, 0.5),
)  # fmt: skip
def test_moves_reach_their_ends_within_every_limit(
    stroke: float, velocity: float, acceleration: float, jerk: float, dwell: float
) -> None:
    limits = {"velocity": velocity, "acceleration": acceleration, "jerk": jerk}
    settings = ReferenceSettings("point_to_point", stroke, dwell=dwell, **limits)
    reference = make_reference(settings)
    period = reference.period  # type: ignore[attr-defined]
    time = np.linspace(0.0, 2.0 * period, 4001)
    position, speed, rate = reference.at(time)
    assert np.abs(speed).max() <= velocity * (1 + 1e-9)
    assert np.abs(rate).max() <= acceleration * (1 + 1e-9)
    assert np.abs(np.diff(rate)).max() <= jerk * (time[1] - time[0]) * (1 + 1e-6) + 1e-9 * acceleration
    assert np.abs(np.diff(position)).max() <= velocity * (time[1] - time[0]) * (1 + 1e-9)
    assert position.min() >= -1e-9 * stroke and position.max() <= stroke * (1 + 1e-9)
    there = reference.at(np.array([0.0, period / 2, period / 2 + dwell, period]))[0]
    np.testing.assert_allclose(there, [0.0, stroke, stroke, 0.0], atol=1e-9 * stroke)
    fastest = stroke / velocity
    assert period >= 2.0 * (dwell + fastest) * (1 - 1e-9)


def test_long_move_uses_all_it_may() -> None:
    reference = make_reference(ReferenceSettings("point_to_point", 0.1, dwell=0.2, **LIMITS))
    _, velocity, acceleration = reference.at(np.linspace(0.0, 3.0, 30001))
    assert velocity.max() == pytest.approx(0.05)
    assert acceleration.max() == pytest.approx(1.0, rel=1e-3)
    assert_derivatives(reference, 3.0, (0.05, 50.0))


def test_dwells_rest_exactly() -> None:
    reference = make_reference(ReferenceSettings("point_to_point", 0.02, dwell=0.2, **LIMITS))
    position, velocity, acceleration = reference.at(np.linspace(0.0, 0.199, 100))
    assert not position.any() and not velocity.any() and not acceleration.any()


def write(path: Path, text: str) -> ReferenceSettings:
    path.write_text(text, encoding="utf-8")
    return ReferenceSettings(kind="file", file=str(path), **LIMITS)


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_file_passes_through_its_points_and_returns(tmp_path: Path, interpolation: str) -> None:
    settings = write(tmp_path / "way.csv", "# a way\ntime [s],position [m]\n2.0,0\n2.1,0.001\n2.3,0.004\n2.4,0.002\n")
    reference = make_reference(replace(settings, interpolation=interpolation))
    position, _, _ = reference.at(np.array([0.0, 0.1, 0.3, 0.4]))
    np.testing.assert_allclose(position, [0.0, 0.001, 0.004, 0.002], atol=1e-15)
    period = reference.period  # type: ignore[attr-defined]
    assert period > 0.4 + 0.002 / 0.05
    time = np.linspace(0.0, 2 * period, 20001)
    position, velocity, acceleration = reference.at(time)
    assert np.abs(np.diff(position)).max() < 2.0 * np.abs(velocity).max() * (time[1] - time[0])
    back = np.mod(time, period) > 0.4
    assert np.abs(velocity[back]).max() <= 0.05 and np.abs(acceleration[back]).max() <= 1.0 + 1e-9
    np.testing.assert_allclose(reference.at(np.array([0.1 + period]))[0], 0.001, atol=1e-12)
    if interpolation == "linear":
        np.testing.assert_allclose(reference.at(np.array([0.2]))[0], 0.0025, atol=1e-15)
    else:
        assert_derivatives(reference, 0.399, (0.05, 5.0))


def test_closed_file_is_smooth_across_its_end(tmp_path: Path) -> None:
    time = np.linspace(0.0, 0.5, 51)
    rows = "\n".join(f"{t},{1e-3 * np.sin(4 * np.pi * t) if 0 < t < 0.5 else 0.0}" for t in time)
    reference = make_reference(write(tmp_path / "sine.csv", rows))
    at = np.linspace(0.0, 2.0, 1999)
    position, velocity, acceleration = reference.at(at)
    np.testing.assert_allclose(position, 1e-3 * np.sin(4 * np.pi * at), atol=1e-8)
    np.testing.assert_allclose(velocity, 4e-3 * np.pi * np.cos(4 * np.pi * at), atol=2e-6)
    assert np.abs(acceleration).max() < 1.1e-3 * (4 * np.pi) ** 2


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "0 lines"),
        ("0,1\n", "1 lines"),
        ("0,1\n0,2\n", r"line 2: time 0\.0 s does not come after"),
        ("0,1\n1,nan\n", "line 2: .* is not finite"),
        ("t,x\n0,1\nend,of file\n", "line 3: 'end' is not a number"),
        ("0;0,5\n1;0,6\n", "line 1: '0;0,5' has semicolons and commas"),
        ("0\n1\n", "line 2: the position is missing"),
        ("t,x\n0,1\n1,abc\n", r"bad\.csv, line 3: 'abc' is not a number; correct or remove the line$"),
    ],
)
def test_unusable_file_is_refused_in_one_sentence(tmp_path: Path, text: str, sentence: str) -> None:
    with pytest.raises(ConfigurationError, match=sentence):
        make_reference(write(tmp_path / "bad.csv", text))


def test_missing_file_and_missing_stroke() -> None:
    with pytest.raises(ConfigurationError, match="cannot be read"):
        make_reference(ReferenceSettings(kind="file", file="nowhere.csv"))
    with pytest.raises(ConfigurationError, match=r"x\.stage\.reference\.file is empty"):
        make_reference(ReferenceSettings(kind="file"))
    with pytest.raises(ConfigurationError, match="gives a point_to_point motion no stroke"):
        make_reference(ReferenceSettings(kind="point_to_point", amplitude=0.0))


@given(st.text(max_size=200))
def test_any_text_is_read_or_refused(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    path = tmp_path_factory.mktemp("reference") / "any.csv"
    path.write_bytes(text.encode("utf-8", "surrogatepass"))
    try:
        reference = make_reference(ReferenceSettings(kind="file", file=str(path)))
    except ConfigurationError:
        return
    assert np.isfinite(reference.at(np.array([0.0]))[0]).all()
