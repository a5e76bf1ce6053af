"""The memory of an estimator in one flat array: a reset or a snapshot is a copy, a call needs one argument.

The array begins with a header: sizes, tuning, counters, and where each field lies. Kernels take the flat array and
look up the few fields that they use: ``forces = matrix(flat, at.FORCES)``, where ``at`` is this module.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, cast

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.estimators.layout import MODEL_SIZE
from sgms_observer.jit import HAS_NUMBA, Kernel

# Header: sizes, then tuning, then counters; only the counters change
N_Z, N_P, HORIZON, INTERVAL = range(4)
IS_MHE, ITERATIONS, TOLERANCE, VARIANCE, WALK, BETA, OUTLIER_NIS, HOLDS_MODES = range(4, 12)
COUNT, SAMPLES, EKF_NEXT, STARTED, HEADER = range(12, 17)

# entries of one measurement record
EFFORT, VELOCITY, ACCELERATION, FACTOR, IS_USED, LEVEL, MEASUREMENT_SIZE = range(7)

PLACE = 4  # numbers after the header per field: its start and its lengths

_TABLE: dict[str, tuple[str, ...]] = {}


def _field(name: str, *shape: str) -> int:
    """Add a field to the table and return its number.

    Args:
        name: that of its constant; ``Memory`` has it in small letters.
        shape: its lengths, by their names in ``allocate``.
    """
    _TABLE[name.lower()] = shape
    return len(_TABLE) - 1


# The table of fields: number, name, shape, meaning. Node k = 0..N, interval k leads from node k to k + 1.
# The model as it was given; see layout.py. ``allocate`` fills these.
NOMINAL_SCALARS = _field("NOMINAL_SCALARS", "scalars")
NOMINAL_ELEMENTS = _field("NOMINAL_ELEMENTS", "rows", "n")
KINDS = _field("KINDS", "p")  # which parameters are estimated: layout.ParameterArrays
SCALE = _field("SCALE", "p")
START = _field("START", "p")
LOWER = _field("LOWER", "p")
UPPER = _field("UPPER", "p")
PROCESS = _field("PROCESS", "n")  # variances of Q per interval
INITIAL = _field("INITIAL", "d")  # initial variances of x
# What evolves; ``forget`` empties these.
X_HAT = _field("X_HAT", "d")  # newest corrected estimate of (element forces [N], p)
COVARIANCE = _field("COVARIANCE", "d", "d")  # its covariance
SLIP = _field("SLIP", "n")  # GMS modes at the newest correction
NOW = _field("NOW", "n")  # element forces at the newest sample [N]
NOW_SLIP = _field("NOW_SLIP", "n")  # modes at the newest sample
NOW_A = _field("NOW_A", "n")  # d now / d x_hat forces (diagonal)
NOW_B = _field("NOW_B", "n", "p")  # d now / d p
NOW_VELOCITY = _field("NOW_VELOCITY", "m")  # steps since the last correction
NOW_PERIOD = _field("NOW_PERIOD", "m")
NOW_FACTOR = _field("NOW_FACTOR", "m")
NOW_BRANCHES = _field("NOW_BRANCHES", "m", "n")  # branch of each step and element (GMS with held modes)
STEP_A = _field("STEP_A", "n")  # d now / d (now one sample before) of the latest step
STEP_B = _field("STEP_B", "n", "p")  # d now / d p of the latest step
SCALARS = _field("SCALARS", "scalars")  # the model with p applied; see layout.py
ELEMENTS = _field("ELEMENTS", "rows", "n")
# The window of the MHE.
PRIOR = _field("PRIOR", "d")  # arrival state
PRIOR_COVARIANCE = _field("PRIOR_COVARIANCE", "d", "d")  # arrival covariance
FORCES = _field("FORCES", "nodes", "n")  # element forces at the nodes [N]
SLIPS = _field("SLIPS", "nodes", "n")  # modes at the nodes
P = _field("P", "p")  # parameters of the window
VELOCITIES = _field("VELOCITIES", "N", "m")  # steps of the intervals
PERIODS = _field("PERIODS", "N", "m")
FACTORS = _field("FACTORS", "N", "m")
BRANCHES = _field("BRANCHES", "N", "m", "n")  # now_branches of the intervals
ENDS = _field("ENDS", "N", "n")  # Phi of each interval
END_SLIPS = _field("END_SLIPS", "N", "n")  # modes at the end of each interval
A = _field("A", "N", "n")  # linearisation of each interval
B = _field("B", "N", "n", "p")
MEASUREMENTS = _field("MEASUREMENTS", "nodes", "record")  # record at each node
ROWS = _field("ROWS", "nodes", "d")  # H at each node
RESIDUALS = _field("RESIDUALS", "nodes")  # measured minus modelled effort at each node [N]
# The window at a trial point, laid out as its namesakes.
TRIAL_FORCES = _field("TRIAL_FORCES", "nodes", "n")
TRIAL_P = _field("TRIAL_P", "p")
TRIAL_ENDS = _field("TRIAL_ENDS", "N", "n")
TRIAL_END_SLIPS = _field("TRIAL_END_SLIPS", "N", "n")
TRIAL_A = _field("TRIAL_A", "N", "n")
TRIAL_B = _field("TRIAL_B", "N", "n", "p")
TRIAL_ROWS = _field("TRIAL_ROWS", "nodes", "d")
TRIAL_RESIDUALS = _field("TRIAL_RESIDUALS", "nodes")
# The subproblem.
DEVIATIONS = _field("DEVIATIONS", "nodes", "d")  # filtered, at each node
COVARIANCES = _field("COVARIANCES", "nodes", "d", "d")
GAINS = _field("GAINS", "nodes", "e", "d")  # one per node and measurement slot
INNOVATIONS = _field("INNOVATIONS", "nodes", "e")
INNOVATION_COVARIANCES = _field("INNOVATION_COVARIANCES", "nodes", "e")
ACTIVE = _field("ACTIVE", "nodes", "d")  # -1, 0 or 1 where a bound holds
STEPS = _field("STEPS", "nodes", "d")  # solution of the subproblem
# One measurement, and scratch.
RECORD = _field("RECORD", "record")  # the measurement being taken in
PREDICTED = _field("PREDICTED", "d", "d")  # covariance at that measurement before it is used
PREDICTED_ROW = _field("PREDICTED_ROW", "d")  # H there
LEAD = _field("LEAD", "n")  # forces on the way from the delayed instant to the present
LEAD_SLIP = _field("LEAD_SLIP", "n")  # modes on that way
PRIOR_FACTOR = _field("PRIOR_FACTOR", "d", "d")  # Cholesky factor of prior_covariance
WORK = _field("WORK", "d")
ADJOINT = _field("ADJOINT", "d")
UNIT = _field("UNIT", "d")

NAMES = tuple(_TABLE)
"""Names of the fields in small letters, by their numbers."""


class Sizes(NamedTuple):
    """Dimensions of an estimator: elements n_z, parameters n_p, horizon N, samples per interval m."""

    n_z: int
    n_p: int
    horizon: int
    samples: int

    @property
    def augmented(self) -> int:
        """Return the length of x = (element forces, p)."""
        return self.n_z + self.n_p


class Tuning(NamedTuple):
    """Estimator settings for the kernels, in the order of the header.

    Attributes:
        is_mhe: MHE rather than EKF.
        iterations: largest number of Gauss-Newton iterations per correction.
        tolerance: relative step that ends them.
        variance: R [N^2].
        walk: variance of each parameter's drift per correction (in shares squared).
        beta: state bound of 14d.
        outlier_nis: normalised innovation squared above which a measurement is rejected; 0 never.
        holds_modes: decide a GMS model's branches at each sample and keep them in the window.
    """

    is_mhe: bool
    iterations: int
    tolerance: float
    variance: float
    walk: float
    beta: float
    outlier_nis: float
    holds_modes: bool


class Memory:
    """Views into a memory by the names of its fields, for Python; kernels look up the fields that they use.

    Args:
        flat: the memory.

    Attributes:
        flags: the header, see the names above.
    """

    def __init__(self, flat: Floats) -> None:
        self.flags = flat[:HEADER]
        self._flat = flat

    def __getattr__(self, name: str) -> Floats:
        """Return the view of a field; ``memory.forces`` is that of ``FORCES``."""
        if name not in _TABLE:
            raise AttributeError(f"an estimator's memory has no field {name!r}")
        place = HEADER + PLACE * NAMES.index(name)
        start = int(self._flat[place])
        shape = [int(length) for length in self._flat[place + 1 : place + 1 + len(_TABLE[name])]]
        return self._flat[start : start + math.prod(shape)].reshape(shape)


def allocate(sizes: Sizes, tuning: Tuning, fixed: Sequence[Floats]) -> Floats:
    """Return an empty memory.

    Args:
        sizes: dimensions of the estimator.
        tuning: its settings.
        fixed: the fields before ``X_HAT``: nominal model, parameters, process and initial variances.
    """
    d = sizes.augmented
    lengths = {
        "scalars": MODEL_SIZE, "rows": 3, "record": MEASUREMENT_SIZE,
        "n": sizes.n_z, "p": sizes.n_p, "d": d, "e": d + 1,
        "m": sizes.samples, "N": sizes.horizon, "nodes": sizes.horizon + 1,
    }  # fmt: skip
    shapes = [[lengths[length] for length in shape] for shape in _TABLE.values()]
    start = HEADER + PLACE * len(shapes)
    flat = np.zeros(start + sum(math.prod(shape) for shape in shapes))
    flat[: len(sizes)] = sizes
    flat[IS_MHE : IS_MHE + len(tuning)] = tuning
    for field, shape in enumerate(shapes):
        place = HEADER + PLACE * field
        flat[place] = start
        flat[place + 1 : place + 1 + len(shape)] = shape
        start += math.prod(shape)
    memory = Memory(flat)
    for name, source in zip(NAMES[:X_HAT], fixed, strict=True):
        getattr(memory, name)[...] = source
    return flat


def forget(flat: Floats) -> None:
    """Empty a memory; sizes, tuning and the model as it was given stay."""
    flat[COUNT:HEADER] = 0.0
    flat[int(flat[HEADER + PLACE * X_HAT]) :] = 0.0


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
    """Return the view of a field of one dimension, by its number."""
    place = HEADER + PLACE * field
    start = int(flat[place])
    return flat[start : start + int(flat[place + 1])]


@_in_kernels((1, 2))
def matrix(flat: Floats, field: int) -> Floats:
    """Return the view of a field of two dimensions, by its number."""
    place = HEADER + PLACE * field
    start, rows, columns = int(flat[place]), int(flat[place + 1]), int(flat[place + 2])
    return flat[start : start + rows * columns].reshape(rows, columns)


@_in_kernels((2, 3))
def layer(flat: Floats, field: int, number: int) -> Floats:
    """Return the view of one matrix, by its number, of a field of three dimensions, by its own."""
    place = HEADER + PLACE * field
    rows, columns = int(flat[place + 2]), int(flat[place + 3])
    start = int(flat[place]) + number * rows * columns
    return flat[start : start + rows * columns].reshape(rows, columns)
