"""What the feedforward of a model leaves, compared with that of an earlier one."""

import numpy as np
import pytest

from sgms_observer.diagnosis.compensation_check import CompensationCheck

Blocks = tuple[np.ndarray, ...]


def blocks(size: float) -> Blocks:
    """Return forty blocks of a force of this rms size."""
    rng = np.random.default_rng(3)
    return tuple(size * rng.standard_normal(50) for _ in range(40))


def left(measured: float, along_reference: float | None) -> CompensationCheck:
    """Return what a feedforward leaves along the measured motion and along a reference, if there is one."""
    reference = () if along_reference is None else blocks(along_reference)
    return CompensationCheck(0.1, 0.1, blocks(measured), reference, has_reference=along_reference is not None)


@pytest.mark.parametrize(
    ("later", "earlier", "grows"),
    [
        (left(0.2, None), left(0.1, None), True),
        (left(0.1, None), left(0.2, None), False),
        (left(0.2, 0.4), left(0.1, 0.3), True),
        (left(0.2, 0.4), left(0.1, 0.4), False),
        (left(0.1, 0.4), left(0.1, 0.3), False),
    ],
)
def test_it_grows_only_along_the_measured_motion_and_the_reference(
    later: CompensationCheck, earlier: CompensationCheck, grows: bool
) -> None:
    assert (later.growth(earlier) > 3.0) == grows
