"""Zero-phase low-pass of many signals at once, the same as ``scipy.signal.sosfiltfilt``.

A fit filters some twenty derivatives again and again. Scipy filters one signal after the other and copies all of them
several times, which takes six times as long. A test holds the two together.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy import signal

from sgms_observer.arrays import Floats
from sgms_observer.jit import njit, njit_bare

Coefficients = tuple[float, ...]
"""Coefficients b0, b1, b2, a1 and a2 of the first and of the second section, ten numbers."""
State = tuple[float, ...]
"""Two states of the first and two of the second section."""

_PAD = 15
"""Samples by which scipy continues both ends of a signal for two sections."""
_WIDTH = 32
"""Signals that are filtered together: enough for the vector unit, few enough for the cache."""


@njit_bare
def _step(
    c: Coefficients, x: float, first: float, second: float, third: float, fourth: float
) -> tuple[float, float, float, float, float]:
    """Return output and state of both sections after one sample ``x`` (direct form II, transposed)."""
    y = c[0] * x + first
    z = c[5] * y + third
    return (
        z,
        c[1] * x - c[3] * y + second,
        c[2] * x - c[4] * y,
        c[6] * y - c[8] * z + fourth,
        c[7] * y - c[9] * z,
    )


@njit
def _pass_over(c: Coefficients, steady: State, values: Floats, is_backward: bool) -> None:
    """Filter signals in place, shape (n, k), each from the state that its first sample would keep for ever."""
    n, k = values.shape
    first, second, third, fourth = np.zeros((4, k))
    for i in range(k):
        start = values[n - 1 if is_backward else 0, i]
        first[i], second[i], third[i], fourth[i] = (
            steady[0] * start,
            steady[1] * start,
            steady[2] * start,
            steady[3] * start,
        )
    for j in range(n):
        row = values[n - 1 - j if is_backward else j]
        for i in range(k):
            row[i], first[i], second[i], third[i], fourth[i] = _step(
                c, row[i], first[i], second[i], third[i], fourth[i]
            )


@njit
def _pass_over_one(c: Coefficients, steady: State, values: Floats, is_backward: bool) -> None:
    """Filter one signal in place, shape (n,), as ``_pass_over``, but with the state in registers."""
    n = values.shape[0]
    start = values[n - 1 if is_backward else 0]
    first, second, third, fourth = steady[0] * start, steady[1] * start, steady[2] * start, steady[3] * start
    for j in range(n):
        k = n - 1 - j if is_backward else j
        values[k], first, second, third, fourth = _step(c, values[k], first, second, third, fourth)


@njit
def _filter(c: Coefficients, steady: State, values: Floats, start: int, step: int, out: Floats) -> None:
    """Write the filtered signals at every ``step``-th sample from ``start`` on, shapes (n, k) and (m, k)."""
    n, k = values.shape
    for left in range(0, k, _WIDTH):
        right = min(left + _WIDTH, k)
        part = np.empty((n + 2 * _PAD, right - left))
        part[_PAD : _PAD + n] = values[:, left:right]
        for i in range(_PAD):
            part[i] = 2.0 * values[0, left:right] - values[_PAD - i, left:right]
            part[n + _PAD + i] = 2.0 * values[n - 1, left:right] - values[n - 2 - i, left:right]
        for is_backward in (False, True):
            if right - left == 1:
                _pass_over_one(c, steady, part[:, 0], is_backward)
            else:
                _pass_over(c, steady, part, is_backward)
        for m in range(out.shape[0]):
            out[m, left:right] = part[_PAD + start + m * step]


@lru_cache(maxsize=16)
def _steady(c: Coefficients) -> State:
    """Return the state for a constant input of 1."""
    sections = np.insert(np.reshape(c, (2, 5)), 3, 1.0, axis=1)
    return tuple(signal.sosfilt_zi(sections).ravel().tolist())


def zero_phase(sections: Floats, values: Floats, samples: slice) -> Floats:
    """Return signals filtered forward and backward, at some of their samples.

    Args:
        sections: second-order sections of a low-pass of the fourth order, shape (2, 6).
        values: shape (n,) or (n, k), more than ``_PAD`` samples; fastest where the signals lie side by side in memory.
        samples: which samples to return.

    Returns:
        Shape (m,) or (m, k).

    Source: Gustafsson 1996, IEEE Trans. Signal Processing 44(4), as in scipy: both ends are continued by the signal
    turned by half a turn around its last sample.
    """
    start, stop, step = samples.indices(len(values))
    columns = np.ascontiguousarray(values, dtype=np.float64).reshape(len(values), -1)
    c = tuple(np.delete(sections, 3, axis=1).ravel().tolist())
    out = np.empty((len(range(start, stop, step)), columns.shape[1]))
    _filter(c, _steady(c), columns, start, step, out)
    return out.reshape(len(out), *values.shape[1:])
