"""Traces: measured and modelled signals below the band, for the report."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sgms_observer.arrays import Booleans, Floats
from sgms_observer.formulas import vectorised
from sgms_observer.identification.identify import OTHER_CORNER, Identification, long_enough
from sgms_observer.identification.least_squares import SYMMETRIC, InverseModelFit, regression
from sgms_observer.identification.prepared import Prepared, parts_of_long, prepare_all
from sgms_observer.identification.problem import (
    DELAY,
    MASS,
    OFFSET,
    RHO,
    V_S,
    VISCOUS,
    ElementShape,
    residual_and_jacobian,
)
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.axis import AxisSettings

_RINGING = 2.0  # periods of the cutoff to the nearest reversal, in which the low-pass rings
_ONE_WAY = 0.97  # mean direction behind a row of least squares where none turns; its low-pass has a ripple of 1 %

stribeck_level = vectorised("friction").stribeck_level


@dataclass(frozen=True)
class Trace:
    """Measured and modelled signals of one piece of a recording, shapes (n,).

    Attributes:
        name: name of the recording.
        time: of each row [s], from 0.
        position, velocity: of each row [m or rad, per s].
        effort: measured effort [N or N m].
        residual: measured minus modelled effort [N or N m].
        friction: effort minus the effort of mass, offset and effects [N or N m].
        is_sliding: whether the axis has moved so far since the last reversal that friction depends on velocity alone.
    """

    name: str
    time: Floats
    position: Floats
    velocity: Floats
    effort: Floats
    residual: Floats
    friction: Floats
    is_sliding: Booleans

    @property
    def modelled(self) -> Floats:
        """Return the modelled effort."""
        return self.effort - self.residual

    @property
    def modelled_friction(self) -> Floats:
        """Return the modelled friction."""
        return self.friction - self.residual


_SIGNALS = tuple(name for name in Trace.__dataclass_fields__ if name != "name")


@dataclass(frozen=True)
class Traces:
    """Traces of all pieces of one axis, and the modelled friction while sliding.

    Attributes:
        learnt: pieces that the model was fitted to.
        held_out: pieces of the held-out recordings.
        curve: friction while sliding [N or N m] at given velocities [m/s or rad/s].
    """

    learnt: tuple[Trace, ...]
    held_out: tuple[Trace, ...]
    curve: Callable[[Floats], Floats]


def unexplained_share(traces: Sequence[Trace]) -> float:
    """Return the rms residual over the rms effort of one piece or more [-]."""
    residual = np.concatenate([trace.residual for trace in traces])
    effort = np.concatenate([trace.effort for trace in traces])
    return float(np.linalg.norm(residual) / np.linalg.norm(effort))


def load_ratio(effort: Floats) -> float:
    """Return the rms of an effort over its rms about its mean [-], which is large under a constant load.

    A share of the rms effort times this ratio is the share of what changes, which a model has to explain: a constant
    load is explained by any offset.

    Args:
        effort: in order of time, shape (n,) [N or N m].
    """
    variation = float(np.std(effort))
    return float(np.sqrt(np.mean(np.square(effort)))) / variation if variation > 0.0 else 1.0


def unexplained_variation(traces: Sequence[Trace]) -> float:
    """Return the rms residual over the rms effort about its mean, of one piece or more [-]."""
    return unexplained_share(traces) * load_ratio(np.concatenate([trace.effort for trace in traces]))


def traces_of(
    result: Identification, axis: AxisSettings, learnt: Sequence[Recording], held_out: Sequence[Recording]
) -> Traces:
    """Return the traces of a GMS or S-GMS identification.

    Args:
        result: from ``identify``.
        axis: the settings that it started from.
        learnt: recordings that the model was fitted to.
        held_out: held-out recordings.
    """
    scalars = result.parameters.scalars
    coulomb = float(result.parameters.level.sum())

    def curve(velocity: Floats) -> Floats:
        level = stribeck_level(velocity, scalars[RHO] * coulomb, coulomb, scalars[V_S])
        return np.asarray(np.sign(velocity) * level + scalars[VISCOUS] * velocity)

    shape = ElementShape.of(axis.friction, result.model)

    def traces_of_recordings(recordings: Sequence[Recording], lowest: float) -> tuple[Trace, ...]:
        pieces = long_enough(recordings, lowest)[0] if len(recordings) else []
        if result.is_opposed:
            pieces = [replace(piece, effort=-piece.effort) for piece in pieces]
        groups = parts_of_long(pieces, result.cutoff, result.terms)
        prepared = iter(prepare_all([part for parts in groups for part in parts], result.cutoff, result.terms))
        return tuple(_trace(parts, [next(prepared) for _ in parts], result, shape) for parts in groups)

    fitted = traces_of_recordings(learnt, OTHER_CORNER * result.cutoff)  # the fit skipped the shorter pieces
    return Traces(fitted, traces_of_recordings(held_out, result.cutoff), curve)


def _trace(
    parts: Sequence[Recording], pieces: Sequence[Prepared], result: Identification, shape: ElementShape
) -> Trace:
    """Return the trace of one piece from its parts, in order of time."""
    masks = [piece.settled(float(result.parameters.slip_deflection.max())) for piece in pieces]
    if not any(np.any(mask) for mask in masks):
        masks = [piece.usable for piece in pieces]
    found = [_trace_of_part(piece, mask, result, shape) for piece, mask in zip(pieces, masks, strict=True)]
    if len(found) == 1:
        return found[0]
    moved = [replace(one, time=part.start - parts[0].start + one.time) for part, one in zip(parts, found, strict=True)]
    joined = (np.concatenate([getattr(one, key) for one in moved]) for key in _SIGNALS)
    return Trace(found[0].name, *joined)


def _trace_of_part(piece: Prepared, mask: Booleans, result: Identification, shape: ElementShape) -> Trace:
    """Return the trace of some rows of a prepared recording."""
    parameters = result.parameters
    scalars = parameters.scalars
    effort = piece.effort(np.clip(piece.time - scalars[DELAY], piece.time[0], piece.time[-1]))
    residual = -residual_and_jacobian(piece, parameters, shape)[0]
    coulomb = float(parameters.level.sum())
    level = stribeck_level(piece.effects.velocity, scalars[RHO] * coulomb, coulomb, scalars[V_S])
    effects = piece.low_pass(piece.effects.at(parameters.effects.values, level)[0])
    friction = effort - scalars[MASS] * piece.acceleration - scalars[OFFSET] - effects
    sliding = piece.is_sliding(float(parameters.slip_deflection.max()), _RINGING / result.cutoff)
    position = piece.position[:: piece.stride]
    return Trace(
        piece.name, piece.time[mask], position[mask], piece.velocity[mask], effort[mask], residual[mask],
        friction[mask], sliding[mask],
    )  # fmt: skip


def least_squares_traces(
    fit: InverseModelFit, learnt: Sequence[Recording], held_out: Sequence[Recording], is_opposed: bool = False
) -> Traces:
    """Return the traces of an inverse dynamic model.

    Args:
        fit: from ``fit_inverse_model``, symmetric.
        learnt: recordings that the model was fitted to.
        held_out: held-out recordings.
        is_opposed: whether the effort was reversed for the fit.
    """
    viscous, coulomb = fit.value("viscous_coefficient"), fit.value("coulomb_force")

    def trace(recording: Recording) -> Trace:
        if is_opposed:
            recording = replace(recording, effort=-recording.effort)
        part = regression(recording, fit.names, fit.cutoff)
        columns = dict(zip(fit.names, part.regressor.T, strict=True))
        residual = part.effort - part.regressor @ fit.values
        velocity = columns[SYMMETRIC[1]]
        friction = residual + viscous * velocity + coulomb * columns[SYMMETRIC[2]]
        position = np.interp(part.time, recording.time, recording.position)
        turning = np.abs(columns[SYMMETRIC[2]]) <= _ONE_WAY
        near = np.ones(2 * int(_RINGING) + 1)  # rows of least squares are a period of the cutoff apart
        sliding = np.convolve(turning, near, mode="same") == 0.0
        return Trace(recording.name, part.time, position, velocity, part.effort, residual, friction, sliding)

    def curve(velocity: Floats) -> Floats:
        return np.asarray(coulomb * np.sign(velocity) + viscous * velocity)

    return Traces(tuple(map(trace, learnt)), tuple(map(trace, held_out)), curve)
