"""The set-points of a recording that starts between two messages."""

from __future__ import annotations

import numpy as np
import pytest

from sgms_observer.offline.recording import MAX_END, Recording

PERIOD = 1.0e-3
COUNT = 2000


def recording(*missing: slice) -> Recording:
    """Return a recording whose set-points lack some samples."""
    reference = np.linspace(1.0, 2.0, COUNT)
    for part in missing:
        reference[part] = np.nan
    return Recording("test", PERIOD, np.zeros(COUNT), np.zeros(COUNT), reference_position=reference)


def test_short_ends_are_filled_with_the_nearest() -> None:
    reference = recording(slice(0, 1), slice(COUNT - 20, COUNT)).whole_reference
    given = np.linspace(1.0, 2.0, COUNT)
    assert reference is not None
    assert reference[0] == given[1] and np.all(reference[-20:] == given[COUNT - 21])
    assert np.array_equal(reference[1 : COUNT - 20], given[1 : COUNT - 20])


@pytest.mark.parametrize("missing", [slice(500, 501), slice(0, round(2.0 * MAX_END / PERIOD)), slice(0, COUNT)])
def test_a_hole_or_a_long_end_is_no_reference(missing: slice) -> None:
    assert recording(missing).whole_reference is None


def test_no_set_points_are_no_reference() -> None:
    assert Recording("test", PERIOD, np.zeros(COUNT), np.zeros(COUNT)).whole_reference is None
