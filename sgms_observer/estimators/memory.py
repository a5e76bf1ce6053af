"""The memory of an estimator in one flat array: a reset or a snapshot is a copy, a call needs one argument.

The array begins with a header: sizes, tuning, counters, and where each field lies. Kernels take the flat array and
look up the few fields that they use: ``forces = matrix(flat, at.FORCES)``, where ``at`` is this module.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, cast

import numpy as np

from sgms_observer.estimators.layout import MODEL_SIZE, Floats
from sgms_observer.jit import HAS_NUMBA, Kernel

# Header: sizes, then tuning, then counters; only the counters change
N_Z, N_P, HORIZON, INTERVAL = range(4)
IS_MHE, ITERATIONS, TOLERANCE, VARIANCE, WALK, BETA, OUTLIER_NIS, HOLDS_MODES = range(4, 12)
COUNT, SAMPLES, EKF_NEXT, STARTED, HEADER = range(12, 17)

# Fields: the model as it was given, then what evolves
(
    NOMINAL_SCALARS, NOMINAL_ELEMENTS, KINDS, SCALE, START, LOWER, UPPER, PROCESS, INITIAL,
    X_HAT, COVARIANCE, SLIP, NOW, NOW_SLIP, NOW_A, NOW_B, NOW_VELOCITY, NOW_PERIOD, NOW_FACTOR, NOW_BRANCHES,
    STEP_A, STEP_B,
    SCALARS, ELEMENTS,
    PRIOR, PRIOR_COVARIANCE, FORCES, SLIPS, P, VELOCITIES, PERIODS, FACTORS, BRANCHES, ENDS, END_SLIPS, A, B,
    MEASUREMENTS, ROWS, RESIDUALS,
    TRIAL_FORCES, TRIAL_P, TRIAL_ENDS, TRIAL_END_SLIPS, TRIAL_A, TRIAL_B, TRIAL_ROWS, TRIAL_RESIDUALS,
    DEVIATIONS, COVARIANCES, GAINS, INNOVATIONS, INNOVATION_COVARIANCES, ACTIVE, STEPS,
    RECORD, PREDICTED, PREDICTED_ROW, LEAD, LEAD_SLIP, PRIOR_FACTOR, WORK, ADJOINT, UNIT,
    FIELDS,
) = range(65)  # fmt: skip

# entries of one measurement record
EFFORT, VELOCITY, ACCELERATION, FACTOR, IS_USED, LEVEL, MEASUREMENT_SIZE = range(7)

PLACE = 4  # numbers behind the header per field: where it starts, and its lengths


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


class Memory(NamedTuple):
    """Views into the flat array. n = n_z, p = n_p, d = n + p; node k = 0..N, interval k leads from node k to k + 1.

    Attributes:
        flags: the header, see the names above.
        nominal_scalars, nominal_elements: the model without p; see layout.py.
        kinds, scale, start, lower, upper: which parameters are estimated; see ``layout.ParameterArrays``.
        process: variances of Q per interval, shape (n,).
        initial: initial variances of x, shape (d,).
        x_hat: newest corrected estimate of (element forces [N], p); shape (d,).
        covariance: its covariance, shape (d, d).
        slip: GMS modes at the newest correction, shape (n,).
        now: element forces at the newest sample [N], shape (n,).
        now_slip: modes at the newest sample, shape (n,).
        now_a: d now / d x_hat forces (diagonal), shape (n,).
        now_b: d now / d p, shape (n, p).
        now_velocity, now_period, now_factor: steps since the last correction, shape (m,).
        now_branches: branch of each of these steps and each element (GMS with held modes), shape (m, n).
        step_a, step_b: d now / d (now one sample before) and / d p of the latest step, shapes (n,), (n, p).
        scalars, elements: the model with p applied; see layout.py.
        prior: arrival state, shape (d,).
        prior_covariance: arrival covariance, shape (d, d).
        forces: element forces at the nodes [N], shape (N + 1, n).
        slips: modes at the nodes, shape (N + 1, n).
        p: parameters of the window, shape (p,).
        velocity, period, factor: steps of the intervals, shape (N, m).
        branches: now_branches of the intervals, shape (N, m, n).
        ends: Phi of each interval, shape (N, n).
        end_slips: modes at the end of each interval, shape (N, n).
        a, b: linearisation of each interval, shapes (N, n), (N, n, p).
        measurements: record at each node, shape (N + 1, MEASUREMENT_SIZE).
        rows: H at each node, shape (N + 1, d).
        residuals: measured minus modelled effort at each node [N], shape (N + 1,).
        trial_forces ... trial_residuals: the window at a trial point, laid out as their namesakes.
        deviations, covariances: filtered, at each node; shapes (N + 1, d), (N + 1, d, d).
        gains, innovations, innovation_covariances: one per node and measurement slot; shapes (N + 1, d + 1, d) and
            (N + 1, d + 1).
        active: -1, 0 or 1 where a bound holds, shape (N + 1, d).
        steps: solution of the subproblem, shape (N + 1, d).
        record: the measurement being taken in, shape (MEASUREMENT_SIZE,).
        predicted, predicted_row: covariance and H at that measurement before it is used, shapes (d, d), (d,).
        lead, lead_slip: forces and modes on the way from the delayed instant to the present, shape (n,).
        prior_factor: Cholesky factor of prior_covariance, shape (d, d).
        work, adjoint, unit: scratch, shape (d,).
    """

    flags: Floats
    nominal_scalars: Floats
    nominal_elements: Floats
    kinds: Floats
    scale: Floats
    start: Floats
    lower: Floats
    upper: Floats
    process: Floats
    initial: Floats
    x_hat: Floats
    covariance: Floats
    slip: Floats
    now: Floats
    now_slip: Floats
    now_a: Floats
    now_b: Floats
    now_velocity: Floats
    now_period: Floats
    now_factor: Floats
    now_branches: Floats
    step_a: Floats
    step_b: Floats
    scalars: Floats
    elements: Floats
    prior: Floats
    prior_covariance: Floats
    forces: Floats
    slips: Floats
    p: Floats
    velocity: Floats
    period: Floats
    factor: Floats
    branches: Floats
    ends: Floats
    end_slips: Floats
    a: Floats
    b: Floats
    measurements: Floats
    rows: Floats
    residuals: Floats
    trial_forces: Floats
    trial_p: Floats
    trial_ends: Floats
    trial_end_slips: Floats
    trial_a: Floats
    trial_b: Floats
    trial_rows: Floats
    trial_residuals: Floats
    deviations: Floats
    covariances: Floats
    gains: Floats
    innovations: Floats
    innovation_covariances: Floats
    active: Floats
    steps: Floats
    record: Floats
    predicted: Floats
    predicted_row: Floats
    lead: Floats
    lead_slip: Floats
    prior_factor: Floats
    work: Floats
    adjoint: Floats
    unit: Floats


def _shapes(sizes: Sizes) -> tuple[tuple[int, ...], ...]:
    """Return the shape of every field, in the fields' order."""
    n, p, h, m = sizes
    d, w, r = n + p, h + 1, MEASUREMENT_SIZE
    return (
        (MODEL_SIZE,), (3, n), (p,), (p,), (p,), (p,), (p,), (n,), (d,),
        (d,), (d, d), (n,), (n,), (n,), (n,), (n, p), (m,), (m,), (m,), (m, n),
        (n,), (n, p),
        (MODEL_SIZE,), (3, n),
        (d,), (d, d), (w, n), (w, n), (p,), (h, m), (h, m), (h, m), (h, m, n), (h, n), (h, n), (h, n), (h, n, p),
        (w, r), (w, d), (w,),
        (w, n), (p,), (h, n), (h, n), (h, n), (h, n, p), (w, d), (w,),
        (w, d), (w, d, d), (w, d + 1, d), (w, d + 1), (w, d + 1), (w, d), (w, d),
        (r,), (d, d), (d,), (n,), (n,), (d, d), (d,), (d,), (d,),
    )  # fmt: skip


def allocate(sizes: Sizes, tuning: Tuning, fixed: Sequence[Floats]) -> Floats:
    """Return an empty memory.

    Args:
        sizes: dimensions of the estimator.
        tuning: its settings.
        fixed: the fields before ``X_HAT``: nominal model, parameters, process and initial variances.
    """
    shapes = _shapes(sizes)
    flat = np.zeros(HEADER + PLACE * FIELDS + sum(math.prod(shape) for shape in shapes))
    flat[: len(sizes)] = sizes
    flat[IS_MHE : IS_MHE + len(tuning)] = tuning
    start = HEADER + PLACE * FIELDS
    for field, shape in enumerate(shapes):
        place = HEADER + PLACE * field
        flat[place] = start
        flat[place + 1 : place + 1 + len(shape)] = shape
        start += math.prod(shape)
    memory = views(flat)
    for target, source in zip(memory[1:], fixed, strict=False):
        target[...] = source
    return flat


def views(flat: Floats) -> Memory:
    """Return the views into a memory, for Python; kernels look up the fields that they use."""
    sizes = Sizes(*(int(size) for size in flat[: INTERVAL + 1]))
    found = []
    for field, shape in enumerate(_shapes(sizes)):
        start = int(flat[HEADER + PLACE * field])
        found.append(flat[start : start + math.prod(shape)].reshape(shape))
    return Memory(flat[:HEADER], *found)


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
