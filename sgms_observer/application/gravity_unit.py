"""Whether a recording shows gravity of a joint, and the unit of the joint's angle in which it does.

Gravity turns with the joint, once in 2 pi rad. So a joint that carries a load tells the unit of its angle. The rest of
the force balance, mass, friction and offset, explains the same in every unit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sgms_observer.application.force_balance import MIN_Z_SCORE, ForceBalance, rigid_rows
from sgms_observer.arrays import Floats
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.units import PRISMATIC, REVOLUTE

RADIANS_PER_DEGREE = math.pi / 180.0
"""Degrees are the one unit beside radians that is looked for: gravity over revolutions looks like a cogging with six
cycles a turn."""
_MAX_SQUARED_RATIO = 0.5
"""Largest ratio of the squared residuals of two models, of which one explains decidedly more."""
_MIN_SINGULAR = 1.0e-4  # of the largest singular value of the scaled columns; below it they are one column
_BLOCKS = 20  # of the residual, in whose scatter a decrease has to show


@dataclass(frozen=True)
class GravityUnit:
    """Shares of the effort that the force balance leaves unexplained, with gravity in several units.

    Attributes:
        without: rms residual without gravity over the effort's standard deviation [-].
        in_radians: the same with gravity of a position in radians [-].
        in_degrees: the same with gravity of a position in degrees [-].
        turns: the recording shows gravity of a joint whose angle is in radians.
        is_in_degrees: it shows gravity of a joint whose angle is in degrees.
    """

    without: float
    in_radians: float
    in_degrees: float
    turns: bool
    is_in_degrees: bool


def gravity_unit(recordings: Sequence[Recording], balance: ForceBalance) -> GravityUnit:
    """Return what the recordings show about gravity and the unit of the angle.

    Args:
        recordings: the pieces that the balance was fitted to.
        balance: rough force balance; gives the band.
    """
    rigid, position, effort = rigid_rows(recordings, balance)
    spread = float(np.std(np.concatenate([piece.effort for piece in recordings])))

    def residual(*forces: Floats) -> Floats:
        return min((_residual(columns, effort, *forces) for columns in rigid), key=_rms)

    without, centred = residual(), position - np.mean(position)
    spring = residual(centred, centred**2)  # gravity over a small angle looks like springs
    radians, degrees = (
        residual(np.sin(factor * position), np.cos(factor * position)) for factor in (1.0, RADIANS_PER_DEGREE)
    )
    is_in_degrees = _is_significantly_smaller(degrees, spring) and _explains_more(degrees, radians)
    turns = not is_in_degrees and _explains_more(radians, without) and _is_significantly_smaller(radians, spring)
    shares = [_rms(left) / spread if spread > 0.0 else 0.0 for left in (without, radians, degrees)]
    return GravityUnit(shares[0], shares[1], shares[2], turns, is_in_degrees)


def gravity_warnings(name: str, gravity: GravityUnit | None, joint_type: str | None) -> list[str]:
    """Return the sentence that gravity asks for another joint type, or for another unit of the angle, if it does.

    Args:
        name: of the axis.
        gravity: what its recording shows; None without a force balance.
        joint_type: prismatic or revolute; None if it is not known.
    """
    if gravity is None:
        return []
    if gravity.turns and joint_type != REVOLUTE:
        return [
            f"{name}: with the gravity of a turning joint the balance of forces leaves"
            f" {100.0 * gravity.in_radians:.3g} % of the effort unexplained, without it"
            f" {100.0 * gravity.without:.3g} %; if this axis turns, set joint_type: revolute (--joint-type revolute)"
        ]
    if gravity.is_in_degrees and joint_type != PRISMATIC:
        return [
            f"{name}: gravity does not act over an angle in radians, which leaves {100.0 * gravity.in_radians:.3g} % of"
            f" the effort unexplained; in degrees it leaves {100.0 * gravity.in_degrees:.3g} %: multiply position_scale"
            f" by {RADIANS_PER_DEGREE:.10g}"
        ]
    return []


def _residual(rigid: Floats, effort: Floats, *forces: Floats) -> Floats:
    """Return what mass, friction, offset and forces of the position leave of the effort [N or N m], shape (n,)."""
    matrix = np.column_stack([rigid, *forces])
    scale = np.linalg.norm(matrix, axis=0)
    matrix = matrix / np.where(scale > 0.0, scale, 1.0)
    return np.asarray(effort - matrix @ np.linalg.lstsq(matrix, effort, rcond=_MIN_SINGULAR)[0])


def _explains_more(residual: Floats, other: Floats) -> bool:
    """Return whether a residual is decidedly and surely smaller than another one."""
    return _rms(residual) ** 2 < _MAX_SQUARED_RATIO * _rms(other) ** 2 and _is_significantly_smaller(residual, other)


def _is_significantly_smaller(residual: Floats, other: Floats) -> bool:
    """Return whether the rms of a residual is smaller by more than the scatter of the decrease over blocks of time."""
    ours, theirs = (
        [_rms(block) for block in np.array_split(values, min(_BLOCKS, len(values)))] for values in (residual, other)
    )
    decrease = np.subtract(theirs, ours)
    return bool(np.sum(decrease) > MIN_Z_SCORE * float(np.linalg.norm(decrease)))


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
