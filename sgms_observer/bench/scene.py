"""Parameter files of the runs that go through the command line and the graph."""

from __future__ import annotations

from pathlib import Path

_SHARED = """/**:
  ros__parameters:
    axes: [{names}]
    sample_period: {period:e}  # s
    publish_every: {publish_every}
"""
_AXIS = """    {name}:
      mass: 10.0                 # kg
      estimator: {{kind: {kind}, parameters: [kappa], correction_every: {every}}}
      compensation: {{enabled: true}}
      stage: {{reference: {{kind: sine, amplitude: 200.0e-6, frequency: 5.0}}}}
"""


RATE = 10_000
"""Samples per second of the scene, unless another rate is asked for [Hz]."""

_CORRECTION = 2.0e-3  # s from one correction to the next


def axis_names(count: int) -> tuple[str, ...]:
    """Return the names of the axes: ``x``, or ``x1``, ``x2``, ... of several."""
    return ("x",) if count == 1 else tuple(f"x{number + 1}" for number in range(count))


def write_config(folder: Path, kind: str, publish_every: int = 1, rate: int = RATE, axes: int = 1) -> Path:
    """Write a parameter file: Table I, the default filter, the stiffness estimated, compensation on.

    Args:
        folder: where to.
        kind: of the estimator, ``ekf`` or ``mhe``.
        publish_every: samples from one published estimate to the next.
        rate: samples per second [Hz].
        axes: how many there are.

    Returns:
        The file.
    """
    path = folder / f"{kind}_{publish_every}_{rate}_{axes}.yaml"
    every = max(1, round(_CORRECTION * rate))
    names = axis_names(axes)
    text = _SHARED.format(names=", ".join(names), publish_every=publish_every, period=1.0 / rate)
    text += "".join(_AXIS.format(name=name, kind=kind, every=every) for name in names)
    path.write_text(text, encoding="utf-8")
    return path
