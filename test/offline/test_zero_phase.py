"""The low-pass of many signals at once is scipy's."""

import numpy as np
import pytest
from scipy import signal

from sgms_observer.offline.zero_phase import zero_phase

SAMPLES = slice(30, 3990, 4)


@pytest.mark.parametrize("count", [1, 2, 16, 19, 70])
@pytest.mark.parametrize("corner", [0.01, 0.2, 0.8])
def test_the_filter_is_that_of_scipy(count, corner):
    """Both ends and every sample agree to the rounding error, whichever way the signals lie in memory."""
    sections = signal.butter(4, corner, output="sos")
    values = np.random.default_rng(count).standard_normal((4000, count)).cumsum(axis=0)
    given = values.copy()
    expected = signal.sosfiltfilt(sections, values, axis=0)
    tolerance = 1e-12 * np.max(np.abs(expected))
    for layout in (values, np.asfortranarray(values)):
        np.testing.assert_allclose(zero_phase(sections, layout, SAMPLES), expected[SAMPLES], rtol=0, atol=tolerance)
    every = zero_phase(sections, values[:, 0], slice(None))
    np.testing.assert_allclose(every, expected[:, 0], rtol=0, atol=tolerance)
    np.testing.assert_array_equal(values, given)
