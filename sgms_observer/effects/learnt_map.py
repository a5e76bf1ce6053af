"""A learnt map in Python: construction from a grid, force along a recording, and columns for a linear fit."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.effects import map_kernel
from sgms_observer.effects.catalogue import effect
from sgms_observer.effects.effect import EffectSettings, flat_values, named_values
from sgms_observer.effects.map_entries import GRIDS, size_of
from sgms_observer.errors import ConfigurationError
from sgms_observer.formulas.learnt_map import COORDINATES
from sgms_observer.jit import njit

if TYPE_CHECKING:
    from scipy import sparse


@dataclass(frozen=True)
class MotionPath:
    """A motion that a map is evaluated along; row i belongs to sample i, what is left out is zero.

    Attributes:
        period: time between two samples [s].
        position: [m], shape (n,).
        velocity: [m/s], shape (n,).
        acceleration: [m/s^2], shape (n,).
        time: time since the first sample of the run [s], shape (n,); counted in periods if left out.
    """

    period: float
    position: Floats | None = None
    velocity: Floats | None = None
    acceleration: Floats | None = None
    time: Floats | None = None

    def columns(self) -> tuple[Floats, Floats, Floats, Floats]:
        """Return position, velocity, acceleration and time [SI units], each of shape (n,).

        Raises:
            ValueError: when nothing is given, or the lengths differ.
        """
        given = [x for x in (self.position, self.velocity, self.acceleration, self.time) if x is not None]
        if not given or len({np.shape(x) for x in given}) > 1:
            raise ValueError(f"a path needs columns of one length, not {[np.shape(x) for x in given]}")
        count = len(given[0])
        time = self.period * np.arange(count) if self.time is None else self.time
        zero = np.zeros(count)
        columns = [zero if x is None else x for x in (self.position, self.velocity, self.acceleration)]
        q, v, a, t = (np.ascontiguousarray(x, dtype=np.float64) for x in (*columns, time))
        return q, v, a, t


@njit
def _weights(q: Any, v: Any, a: Any, t: Any, h: float, s: Any, p: Any, first: Any, step: Any, weights: Any) -> None:
    """Write, for each sample, which values count and with what weight."""
    for k in range(q.shape[0]):
        s[0], s[1], s[2], s[3], s[4] = map_kernel.learnt_map_next(v[k], h, s, p)
        first[k], step[k], weights[k, 0], weights[k, 1], weights[k, 2], weights[k, 3] = map_kernel.learnt_map_weights(
            q[k], v[k], a[k], t[k], s, p
        )


@njit
def _coordinates(numbers: Any, q: Any, v: Any, a: Any, t: Any, h: float, s: Any, p: Any, out: Any) -> None:
    """Write the coordinates of each sample."""
    for k in range(q.shape[0]):
        s[0], s[1], s[2], s[3], s[4] = map_kernel.learnt_map_next(v[k], h, s, p)
        for i in range(numbers.shape[0]):
            out[k, i] = map_kernel.coordinate(numbers[i], q[k], v[k], a[k], t[k], s)


def learnt_coordinates(names: tuple[str, ...], path: MotionPath, reversal_distance: float = 1.0e-5) -> Floats:
    """Return the coordinates of a map along a path, as the map computes them [SI units], shape (n, len(names)).

    Args:
        names: some of ``COORDINATES``.
        path: the motion.
        reversal_distance: travel over which the direction reverses [m].
    """
    q, v, a, t = path.columns()
    numbers = np.array([COORDINATES.index(name) for name in names], dtype=np.int64)
    out = np.empty((len(q), len(names)))
    _coordinates(numbers, q, v, a, t, path.period, np.zeros(5), np.array([1.0, reversal_distance]), out)
    return out


@dataclass(frozen=True)
class LearntMap:
    """A force over one or two coordinates: linear between grid points, zero beyond a tenth of the range outside.

    Attributes:
        coordinates: one or two of ``COORDINATES``.
        grids: grid points of each coordinate [SI units], rising; those of ``direction`` are always -1 and 1.
        values: forces at the grid points [N], the last coordinate running fastest.
        reversal_distance: travel over which the direction reverses [m].
        scale: factor on the values [-].
        name: ``learnt_map``, ``learnt_map_2`` or ``learnt_map_3``.

    Raises:
        ConfigurationError: when grids and values make no table; one sentence per fault.
    """

    coordinates: tuple[str, ...]
    grids: tuple[tuple[float, ...], ...]
    values: tuple[float, ...]
    reversal_distance: float = 1.0e-5
    scale: float = 1.0
    name: str = "learnt_map"

    def __post_init__(self) -> None:
        """Make plain tuples of arrays and check the table."""
        object.__setattr__(self, "coordinates", tuple(self.coordinates))
        grids = [
            (-1.0, 1.0) if key == "direction" else tuple(float(x) for x in grid)
            for key, grid in zip(self.coordinates, self.grids, strict=True)
        ]
        object.__setattr__(self, "grids", tuple(grids))
        object.__setattr__(self, "values", tuple(float(x) for x in np.asarray(self.values).ravel()))
        faults = effect(self.name).check(self.settings().values, "effects")
        if faults:
            raise ConfigurationError(faults)

    @classmethod
    def zero(
        cls, coordinates: tuple[str, ...], grids: tuple[tuple[float, ...], ...], reversal_distance: float = 1.0e-5
    ) -> LearntMap:
        """Return a map without force over these grids, to be filled by ``basis`` and ``filled``.

        Args:
            coordinates: as the class has them.
            grids: as the class has them [SI units].
            reversal_distance: travel over which the direction reverses [m].
        """
        by_name = dict(zip(coordinates, grids, strict=True))
        return cls(coordinates, grids, (0.0,) * size_of(tuple(coordinates), by_name), reversal_distance)

    @classmethod
    def of(cls, settings: EffectSettings) -> LearntMap:
        """Return the map that settings hold.

        Args:
            settings: of an effect ``learnt_map``, ``learnt_map_2`` or ``learnt_map_3``.
        """
        named = named_values(effect(settings.name), settings.values) or {}
        grids = tuple(named.get(key, ()) for key in named["coordinates"])
        return cls(
            named["coordinates"], grids, named["values"], named["reversal_distance"], named["scale"], settings.name
        )

    def settings(self) -> EffectSettings:
        """Return the map as an effect of an axis, for ``AxisSettings.effects`` and for the parameter file."""
        named: dict[str, Any] = {
            key: grid for key, grid in zip(self.coordinates, self.grids, strict=True) if key in GRIDS
        }
        named.update(
            scale=self.scale, reversal_distance=self.reversal_distance, coordinates=self.coordinates, values=self.values
        )
        return EffectSettings(self.name, flat_values(effect(self.name), named))

    def filled(self, values: Floats) -> LearntMap:
        """Return the map over the same grids with other values.

        Args:
            values: forces at the grid points [N], in any shape that runs through them in order.
        """
        return replace(self, values=tuple(np.asarray(values).ravel()))

    def table(self) -> Floats:
        """Return the values by grid point [N], shape (n1,) or (n1, n2)."""
        return np.reshape(np.array(self.values), [len(grid) for grid in self.grids])

    def force(self, path: MotionPath) -> Floats:
        """Return the map's force along a path that starts at rest [N], shape (n,)."""
        forces: Floats = self.scale * (self.basis(path) @ np.array(self.values))
        return forces

    def basis(self, path: MotionPath) -> sparse.csr_matrix:
        """Return the matrix that gives the force along a path from the values, without the scale [-], shape (n, k)."""
        from scipy import sparse  # only offline work needs it; the nodes start without

        q, v, a, t = path.columns()
        count, size = len(q), len(self.values)
        first, step = np.empty(count, dtype=np.int64), np.empty(count, dtype=np.int64)
        weights = np.empty((count, 4))
        p = np.array(self.settings().values)
        _weights(q, v, a, t, path.period, np.zeros(5), p, first, step, weights)
        columns = np.stack([first, first + 1, first + step, first + step + 1], axis=1)
        rows = np.repeat(np.arange(count), 4)
        return sparse.csr_matrix((weights.ravel(), (rows, columns.ravel())), shape=(count, size))
