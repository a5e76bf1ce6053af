"""The next sample of one axis, with everything in place before it comes: settings, kernels, arrays.

Between two samples at 1 kHz the processor's caches fill with other work. Each object that Python looks at then costs a
fetch from memory, and to look at many took longer than the kernels compute. So all that can be looked up is looked up
as soon as the sample before is out, and handed to one call.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from sgms_observer.observer.axis_observer import AxisObserver
from sgms_observer.observer.block_arrays import BlockArrays, Observed
from sgms_observer.observer.samples import Samples

Step = Callable[[Samples], Observed]


def prepare_next(observer: AxisObserver) -> Step | None:
    """Return ``observer.observe`` for one sample, to be called once, under the present settings.

    Its numbers are those of ``observe``, to the last bit.

    Args:
        observer: of the axis.

    Returns:
        None where more than the four kernels is needed: effects, or a deadline.
    """
    effects = observer.effects
    if effects.names or observer.axis.estimator.deadline > 0.0:
        return None
    arrays, compensator = observer.make_arrays(1), observer.compensator
    fills = observer.differentiator.fill, compensator.fill_ahead, observer.estimator.fill, compensator.fill
    return partial(_observe, *fills, time.perf_counter, np.copyto, arrays, arrays.motion.table, arrays.results.table)


def _observe(
    fill_motion: Callable[..., None],
    fill_ahead: Callable[..., None],
    fill_results: Callable[..., None],
    fill_compensation: Callable[..., None],
    now: Callable[[], float],
    copy: Callable[..., Any],
    arrays: BlockArrays,
    motion: Any,
    results: Any,
    samples: Samples,
) -> Observed:
    """Do what ``AxisObserver.observe`` does for an axis without effects."""
    start = now()
    _, ahead, filtered_effort, effort, _, compensation, _, no_force, no_factor = arrays
    fill_motion(samples.stamp_ns, samples.position, samples.effort, motion)
    fill_ahead(motion, samples.reference_position, samples.reference_velocity, ahead)
    copy(effort, filtered_effort)
    fill_results(motion, effort, no_factor, results)
    fill_compensation(motion, results, ahead, no_force, no_factor, compensation)
    return Observed(samples.stamp_ns, arrays, now() - start)
