"""Pictures of runs as they really come: with gaps, without truth, without a reversal."""

from __future__ import annotations

import numpy as np
import pytest

from sgms_observer.report.run_pictures import Run, Tracking, clearest_reversal, run_pictures, tracking_picture


def a_run(time: np.ndarray, has_truth: bool = True) -> Run:
    """A sine of 5 Hz at these times."""
    position = 2e-4 * np.sin(2 * np.pi * 5 * time)
    velocity = 2e-4 * 2 * np.pi * 5 * np.cos(2 * np.pi * 5 * time)
    friction = 4.0 * np.sign(velocity)
    truth = friction + 0.01 if has_truth else np.full(len(time), np.nan)
    return Run(time, position, velocity, position, friction, np.full(len(time), 0.1), truth, 0.9 * friction)


SECONDS = np.arange(4000) * 1e-3


@pytest.mark.parametrize("window", [(1.0, 1.4), (0.0, 0.2), (3.9, 5.0), (6.0, 6.4)])
@pytest.mark.parametrize("has_truth", [True, False])
def test_a_window_with_or_without_samples(window: tuple[float, float], has_truth: bool) -> None:
    pictures = run_pictures(a_run(SECONDS, has_truth), window)
    assert len({picture.name for picture in pictures}) == 4
    assert all(picture.png.startswith(b"\x89PNG") for picture in pictures)
    _motion, friction, hysteresis, reversal = (picture.caption for picture in pictures)
    assert friction.endswith("the compensation as sent; it acts one look-ahead later.")
    assert hysteresis.endswith("a Coulomb model cannot reproduce this hysteresis.")
    assert reversal.startswith("One reversal, magnified, at ")


def test_a_gap_in_the_recording_moves_the_window() -> None:
    holey = a_run(SECONDS[(SECONDS < 1.0) | (SECONDS > 2.0)])
    assert len(run_pictures(holey, (1.3, 1.7))) == 4


def test_a_reversal_is_where_the_velocity_changes_sign() -> None:
    assert abs(clearest_reversal(a_run(SECONDS)) - 3.85) < 2e-3
    still = a_run(np.arange(100) * 1e-3 * 0.1)
    assert clearest_reversal(still) == still.time[-1]


@pytest.mark.parametrize(
    "before, after, span",
    [
        ((1.0, 1.4), (3.6, 4.0), "the last 0.4 s of each part."),
        ((-0.15, 0.25), (3.6, 4.0), "the last 0.25 s without and 0.4 s with it."),
        ((1.0, 1.4), (3.9, 4.3), "the last 0.4 s without and 0.099 s with it."),
    ],
)
def test_the_caption_of_the_tracking_error_states_the_span_that_is_drawn(
    before: tuple[float, float], after: tuple[float, float], span: str
) -> None:
    tracking = Tracking(SECONDS, 1e-6 * np.sin(30.0 * SECONDS))
    assert tracking_picture(tracking, before, after, "a").caption.endswith(span)


def test_no_line_crosses_missing_samples() -> None:
    holey = a_run(SECONDS[(SECONDS < 1.0) | (SECONDS > 2.0)])
    drawn = holey.with_breaks(0.02)
    (row,) = np.flatnonzero(np.isnan(drawn.position))
    assert 1.0 < drawn.time[row] < 2.0 and np.all(np.diff(drawn.time) > 0.0) and np.isnan(drawn.truth[row])
    assert len(run_pictures(drawn, (0.8, 2.4))) == 4
    sparse = a_run(SECONDS[::100])
    assert len(sparse.with_breaks(0.02).time) == len(sparse.time)
    error = Tracking(holey.time, holey.friction).with_breaks(0.02).error
    assert np.count_nonzero(np.isnan(error)) == 1
