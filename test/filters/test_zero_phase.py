"""The filter forth and back is scipy's, to the last bit."""

import numpy as np
import pytest
from scipy import signal

from sgms_observer.filters.zero_phase import zero_phase

FILTERS = {
    "one section": signal.butter(2, 0.1, output="sos"),
    "an order that is odd": signal.butter(3, 0.3, output="sos"),
    "two in a row": np.concatenate([signal.butter(4, 0.05, output="sos"), signal.butter(4, 0.2, output="sos")]),
    "with ripple": signal.cheby1(8, 0.05, 0.04, output="sos"),
}


@pytest.mark.parametrize("sections", FILTERS.values(), ids=FILTERS)
def test_it_gives_the_bits_of_scipy(sections: np.ndarray) -> None:
    rng = np.random.default_rng(1)
    for shape in ((300,), (300, 1), (300, 3), (301, 40)):
        signals = 3.0 + np.cumsum(rng.normal(size=shape), axis=0)
        assert np.array_equal(zero_phase(sections, signals), signal.sosfiltfilt(sections, signals, axis=0)), shape
    transposed = rng.normal(size=(5, 200)).T  # in memory as a map's columns are
    before = transposed.copy()
    assert np.array_equal(zero_phase(sections, transposed), signal.sosfiltfilt(sections, transposed, axis=0))
    assert np.array_equal(transposed, before)


def test_a_short_signal_is_refused_as_by_scipy() -> None:
    sections = FILTERS["with ripple"]
    shortest = 3 * (2 * len(sections) + 1) + 1
    assert np.array_equal(
        zero_phase(sections, np.arange(float(shortest))), signal.sosfiltfilt(sections, np.arange(float(shortest)))
    )
    with pytest.raises(ValueError, match="padlen"):
        zero_phase(sections, np.arange(float(shortest - 1)))


def test_what_is_not_finite_stays_in_its_signal() -> None:
    signals = np.random.default_rng(2).normal(size=(200, 3))
    signals[50, 1] = np.nan
    found = zero_phase(FILTERS["one section"], signals)
    assert np.isnan(found[:, 1]).all() and np.isfinite(found[:, [0, 2]]).all()
