"""The estimator's memory follows from one table: numbers, names, shapes and places belong together."""

from __future__ import annotations

import numpy as np
import pytest

from sgms_observer.estimators import memory as at
from sgms_observer.estimators.memory import HEADER, NAMES, PLACE, Memory, Sizes, Tuning, allocate, forget

TUNING = Tuning(True, 3, 1e-6, 0.01, 1e-6, 1.2, 25.0, False)


def _fixed(sizes: Sizes) -> list[np.ndarray]:
    """Return a model as it is given, each entry another number."""
    n, p, d = sizes.n_z, sizes.n_p, sizes.n_z + sizes.n_p
    shapes = [(at.MODEL_SIZE,), (3, n), *[(p,)] * 5, (n,), (d,)]
    return [100.0 * (k + 1) + np.arange(np.prod(shape)).reshape(shape) for k, shape in enumerate(shapes)]


def test_each_constant_is_the_number_of_its_name() -> None:
    assert [getattr(at, name.upper()) for name in NAMES] == list(range(len(NAMES)))


@pytest.mark.parametrize("sizes", [Sizes(4, 2, 5, 10), Sizes(1, 0, 1, 1), Sizes(2, 7, 20, 3)])
def test_fields_lie_one_behind_the_other_and_fill_the_memory(sizes: Sizes) -> None:
    flat = allocate(sizes, TUNING, _fixed(sizes))
    memory = Memory(flat)
    end = HEADER + PLACE * len(NAMES)
    for number, name in enumerate(NAMES):
        view = getattr(memory, name)
        place = HEADER + PLACE * number
        assert flat[place] == end, name
        assert tuple(flat[place + 1 : place + 1 + view.ndim]) == view.shape, name
        assert view.base is not None and np.shares_memory(view, flat) == (view.size > 0)
        end += view.size
    assert end == len(flat)


def test_a_reset_keeps_sizes_tuning_and_the_model_only() -> None:
    sizes = Sizes(3, 2, 4, 5)
    flat = allocate(sizes, TUNING, _fixed(sizes))
    fresh = flat.copy()
    memory = Memory(flat)
    for given, name in zip(_fixed(sizes), NAMES, strict=False):
        np.testing.assert_array_equal(getattr(memory, name), given)
    for name in NAMES[at.X_HAT :]:
        getattr(memory, name)[...] = 7.0
    memory.flags[at.COUNT] = 3.0
    forget(flat)
    np.testing.assert_array_equal(flat, fresh)


def test_an_unknown_field_is_an_error() -> None:
    sizes = Sizes(1, 0, 1, 1)
    with pytest.raises(AttributeError, match="no field 'velocity'"):
        _ = Memory(allocate(sizes, TUNING, _fixed(sizes))).velocity
