"""An effort that acts before its stamp: the log stamps it late, or the position early.

No machine makes such a lag: a cause comes before what it does. A drive that reports a filtered or averaged effort, a
slower bus for the effort, and a table whose columns are off by a row make it. The lag is read while the contact slides
fast, where contact laws hardly differ, beside mass, spring, dead zone and friction. The effort is read as much earlier.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from sgms_observer.arrays import Floats
from sgms_observer.diagnosis.criteria import Criteria
from sgms_observer.diagnosis.effort_lag import MAX_STAMP_ERROR, MIN_HELD_LAG
from sgms_observer.diagnosis.instruments import first_strength, forces_beside, instruments_of
from sgms_observer.diagnosis.model import Model, predict
from sgms_observer.diagnosis.motion import EDGE_TIME, MIN_DURATION, EffortLag, delayed, motion_of
from sgms_observer.diagnosis.sliding import slides_fast
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.units import Units

MAX_STEPS = 20
"""Largest number of steps of the fit of a lag."""
MAX_STEP = 2.0
"""Largest step of the fit [samples]: the fit is linear in a small lag only."""
MIN_STEP = 0.01
"""Step at which the fit has converged [samples]."""
STIFFER = 1.0e3
"""Factor on the stiffness of the elements for a contact that slides nearly at once."""
LAG_STEP = 0.1
"""Step of the derivative with respect to the lag [samples]."""


@dataclass(frozen=True)
class LateStamps:
    """Recordings of one name whose effort acts before its stamp.

    Attributes:
        name: of the recordings.
        samples: by how many samples it acts before its stamp.
        seconds: the same [s].
        shift: by how many samples it is late, compared with the lag of the settings.
    """

    name: str
    samples: float
    seconds: float
    shift: float

    def warning(self, units: Units) -> str:
        """Return what the recording says, and what to do."""
        return (
            f"the effort of {self.name} acts before its stamp, by {units.readable(self.seconds, 's')}"
            f" ({self.samples:.2g} samples), and was read earlier. Stamp effort and position when they are"
            " taken, and log an effort that is not filtered"
        )

    def corrected(self, record: Recording) -> Recording:
        """Return a recording of this name whose effort has the lag of the settings."""
        limits = record.effort_limits  # of the efforts as they were recorded
        return replace(record, effort=delayed(record.effort, -self.shift), recorded_limits=limits)


def late_stamps(
    records: Sequence[Recording], model: Model, stated_lag: float, band: float, criteria: Criteria
) -> tuple[LateStamps, ...]:
    """Return the recordings whose effort surely acts before its stamp, by more than inexact stamps make.

    Args:
        records: all recordings. Those of one name are pieces of one log and have one lag.
        model: the given model.
        stated_lag: lag of the effort that follows from the settings, in samples.
        band: upper frequency of the residuals [Hz].
        criteria: thresholds.
    """
    if any(item.name == "actuator_delay" for item in model.effects):
        return ()  # a lag of the effort may then be an error of this delay
    names = list(dict.fromkeys(record.name for record in records))
    least, found = criteria.z_score_of(len(names)), []
    for name in names:
        some = [record for record in records if record.name == name]
        lags = [lag_in_fast_sliding(some, one, band, criteria) for one in (model, without_presliding(model))]
        sure = [lag for lag in lags if lag is not None and lag[0] + least * lag[1] < -MAX_STAMP_ERROR]
        if len(sure) == len(lags):
            lag, _ = min(sure, key=lambda one: one[1])
            found.append(LateStamps(name, -lag, -lag * some[0].period, stated_lag - lag))
    return tuple(found)


def without_presliding(model: Model) -> Model:
    """Return a model whose contact slides nearly at once.

    In a file whose elements are too soft, friction that is still changing looks like sliding friction, and like a lag.
    """
    stiffness = tuple(STIFFER * kappa for kappa in model.friction.element_stiffness)
    return replace(model, friction=replace(model.friction, element_stiffness=stiffness))


def is_significantly_not_held(records: Sequence[Recording], model: Model, band: float, criteria: Criteria) -> bool:
    """Return whether the effort of recordings surely is not held between samples.

    Args:
        records: recordings with one lag.
        model: rough model; the stiffness of its elements does not count.
        band: upper frequency of the residuals [Hz].
        criteria: thresholds.
    """
    long = [record for record in records if record.duration >= MIN_DURATION]
    lag = lag_in_fast_sliding(long, without_presliding(model), band, criteria) if long else None
    return lag is not None and abs(lag[0]) + criteria.min_z_score * lag[1] < MIN_HELD_LAG


def corrected(records: Sequence[Recording], found: Sequence[LateStamps]) -> tuple[Recording, ...]:
    """Return recordings whose efforts have the lag of the settings."""
    by_name = {item.name: item for item in found}
    return tuple(by_name[one.name].corrected(one) if one.name in by_name else one for one in records)


def lag_in_fast_sliding(
    records: Sequence[Recording], model: Model, band: float, criteria: Criteria
) -> tuple[float, float] | None:
    """Return the common lag of the effort of recordings and its standard error [samples], or None without a sure fit.

    The residual is fitted with the change of the effort by a lag, a mass, a spring, and Coulomb, viscous and
    logarithmic friction beside a constant, and with a dead zone if that is significant: it jumps where the effort
    changes its sign, which looks like a lag. The error comes from the scatter between blocks of time. Few of them
    hardly tell it, so it is enlarged as Student's distribution asks at ``min_z_score``. Where every recording has a
    reference, it is the instrument: a controller feeds the noise of the encoder back into the effort. Without one, what
    the model lacks may correlate with the rate of the effort, and the lag has to close half of what these forces leave.

    Args:
        records: recordings with one lag.
        model: the given model.
        band: upper frequency of the residuals [Hz].
        criteria: thresholds.
    """
    motions = [motion_of(record, EffortLag((0.0,)), band) for record in records]
    fast = slides_fast(model, motions)
    length = round(criteria.block / motions[0].residual_period)
    count = sum(int(np.count_nonzero(at)) for at in fast) // length * length
    if count < 2 * length:
        return None

    def together(parts: Sequence[Floats]) -> Floats:
        return np.concatenate([values[at] for values, at in zip(parts, fast, strict=True)])[:count]

    command = together([motion.low_pass(motion.effort - predict(model, motion).residual) for motion in motions])
    others = together([forces_beside(motion) for motion in motions])
    references = [reference for record in records if (reference := _moving_reference(record)) is not None]
    instruments = None
    if len(references) == len(motions):
        instruments = together([instruments_of(*pair) for pair in zip(motions, references, strict=True)])

    def residual_at(lag: float) -> Floats:
        return together([motion.low_pass(delayed(motion.effort, lag / motion.step)) for motion in motions]) - command

    blocks, largest, found = count // length, EDGE_TIME / records[0].period, None
    dead_zone = np.sign(residual_at(0.0) + command)[:, None]  # noise hardly changes it: it is its own instrument
    with_it = np.hstack([dead_zone, others])
    if np.linalg.matrix_rank(with_it) == with_it.shape[1] and blocks > 1 + with_it.shape[1]:
        its_instruments = None if instruments is None else np.hstack([dead_zone, instruments])
        found = _fitted_lag(residual_at, with_it, its_instruments, length, largest)
        if found is not None:
            columns = np.hstack([dead_zone, found.slope[:, None], others])
            used = columns if its_instruments is None else its_instruments
            width, error = first_strength(residual_at(found.lag), columns, used, length)
            if abs(width) <= error * _enlarged(criteria.min_z_score, blocks - columns.shape[1]):
                found = None
    if found is not None:
        others = with_it
    else:
        found = _fitted_lag(residual_at, others, instruments, length, largest)
    free = blocks - 1 - others.shape[1]  # blocks beyond the fitted lag and forces
    if found is None or free < 1:
        return None
    left, first = (_squared_beside(others, residual_at(lag)) for lag in (found.lag, 0.0))
    if instruments is None and 1.0 - left / max(first, 1.0e-300) < criteria.min_imitable_share:
        return None
    return found.lag, found.error * _enlarged(criteria.min_z_score, free) / criteria.min_z_score


def _enlarged(z_score: float, free: int) -> float:
    """Return the z-score that Student's distribution asks for in place of one of the normal distribution.

    Args:
        z_score: of the normal distribution.
        free: degrees of freedom.
    """
    return float(stats.t.isf(stats.norm.sf(z_score), free))


@dataclass(frozen=True)
class _Lag:
    """A fitted lag.

    Attributes:
        lag: [samples].
        error: its standard error, by its scatter between blocks of time [samples].
        slope: decrease of the residual with the lag, shape (n,) [N per sample].
    """

    lag: float
    error: float
    slope: Floats


def _fitted_lag(
    residual_at: Callable[[float], Floats],
    others: Floats,
    instruments: Floats | None,
    length: int,
    largest: float,
) -> _Lag | None:
    """Return the lag beside which forces leave least of the residual, or None where the fit does not converge.

    Args:
        residual_at: residual with the effort read at a lag [samples], shape (n,).
        others: forces that are fitted beside it, shape (n, k).
        instruments: of lag and forces, shape (n, at least k + 1); they themselves if None.
        length: number of samples of a block.
        largest: magnitude of the lag beyond which the fit is given up [samples].
    """
    lag = 0.0
    for _ in range(MAX_STEPS):
        now = residual_at(lag)
        slope = (now - residual_at(lag + LAG_STEP)) / LAG_STEP
        if not np.any(slope):
            return None
        columns = np.column_stack([slope, others])
        step, error = first_strength(now, columns, columns if instruments is None else instruments, length)
        lag += float(np.clip(step, -MAX_STEP, MAX_STEP))
        if abs(lag) > largest:
            return None
        if abs(step) < MIN_STEP:
            return _Lag(lag, error, slope)
    return None


def _moving_reference(record: Recording) -> Floats | None:
    """Return the set-points of a recording, or None without them and where they stand still."""
    reference = record.whole_reference
    return reference if reference is not None and np.ptp(reference) > record.encoder_step else None


def _squared_beside(columns: Floats, residual: Floats) -> float:
    """Return the squared residual that the best strengths of columns leave."""
    return float(np.sum((residual - columns @ np.linalg.lstsq(columns, residual, rcond=None)[0]) ** 2))
