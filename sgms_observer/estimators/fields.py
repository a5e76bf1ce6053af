"""Fields of an estimator's memory inside kernels, without numpy's reshape and slices: those cost more than a step.

Without numba the same functions run as the Python they are written in.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

from sgms_observer.estimators.layout import Floats
from sgms_observer.estimators.memory import HEADER, PLACE
from sgms_observer.jit import HAS_NUMBA, Kernel


def _generator(lengths: tuple[int, ...]) -> Callable[..., Any]:
    """Return the code generator of such a view; numba calls it with LLVM's builder."""
    from numba.core import types
    from numba.np import arrayobj

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        def constant(value: int) -> Any:
            return context.get_constant(types.intp, value)

        make: Any = arrayobj.make_array
        populate: Any = arrayobj.populate_array
        flat = make(signature.args[0])(context, builder, arguments[0])
        place = builder.add(constant(HEADER), builder.mul(arguments[1], constant(PLACE)))

        def entry(number: int) -> Any:
            value = builder.load(builder.gep(flat.data, [builder.add(place, constant(number))]))
            return builder.fptosi(value, context.get_value_type(types.intp))

        start, shape = entry(0), [entry(number) for number in lengths]
        strides = [constant(8)]
        if len(shape) == 2:
            strides.insert(0, builder.mul(shape[1], constant(8)))
        if len(arguments) == 3:
            start = builder.add(start, builder.mul(arguments[2], builder.mul(shape[0], shape[1])))
        view = make(signature.return_type)(context, builder)
        populate(
            view, data=builder.gep(flat.data, [start]), shape=shape, strides=strides, itemsize=constant(8), meminfo=None
        )
        return view._getvalue()

    return generate


def _in_kernels(lengths: tuple[int, ...]) -> Callable[[Kernel], Kernel]:
    """Return what turns a function below into one that kernels compile into two loads and an address.

    Args:
        lengths: which numbers of the field's place are the view's lengths.
    """

    def lower(function: Kernel) -> Kernel:
        if not HAS_NUMBA:
            return function
        from numba.core.types import Array, float64, intp
        from numba.extending import intrinsic

        view, generate = Array(float64, len(lengths), "C"), _generator(lengths)

        def typed(typing_context: Any, flat: Any, field: Any) -> Any:
            return view(flat, intp), generate

        def typed_with_number(typing_context: Any, flat: Any, field: Any, number: Any) -> Any:
            return view(flat, intp, intp), generate

        lowered: Any = intrinsic(typed if lengths[0] == 1 else typed_with_number)
        return cast(Kernel, lowered)

    return lower


@_in_kernels((1,))
def vector(flat: Floats, field: int) -> Floats:
    """Return a field of one dimension."""
    place = HEADER + PLACE * field
    start = int(flat[place])
    return flat[start : start + int(flat[place + 1])]


@_in_kernels((1, 2))
def matrix(flat: Floats, field: int) -> Floats:
    """Return a field of two dimensions; arguments as ``vector``."""
    place = HEADER + PLACE * field
    start, rows, columns = int(flat[place]), int(flat[place + 1]), int(flat[place + 2])
    return flat[start : start + rows * columns].reshape(rows, columns)


@_in_kernels((2, 3))
def layer(flat: Floats, field: int, number: int) -> Floats:
    """Return one matrix of a field of three dimensions."""
    place = HEADER + PLACE * field
    rows, columns = int(flat[place + 2]), int(flat[place + 3])
    start = int(flat[place]) + number * rows * columns
    return flat[start : start + rows * columns].reshape(rows, columns)
