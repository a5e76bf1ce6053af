"""Parameter files of the runs that go through the command line and the graph."""

from __future__ import annotations

from pathlib import Path

_TEXT = """/**:
  ros__parameters:
    axes: [x]
    sample_period: {period:e}  # s
    publish_every: {publish_every}
    x:
      mass: 10.0                 # kg
      estimator: {{kind: {kind}, parameters: [kappa], correction_every: {every}}}
      compensation: {{enabled: true, timeout: 10.0}}  # what is late is late, and not left out
      stage: {{reference: {{kind: sine, amplitude: 200.0e-6, frequency: 5.0}}}}
"""


RATE = 10_000
"""Samples per second of the scene, unless another rate is asked for [Hz]."""

_CORRECTION = 2.0e-3  # s from one correction to the next


def write_config(folder: Path, kind: str, publish_every: int = 1, rate: int = RATE) -> Path:
    """Write a parameter file: one axis, Table I, the default filter, the stiffness estimated, compensation on.

    Args:
        folder: where to.
        kind: of the estimator, ``ekf`` or ``mhe``.
        publish_every: samples from one published estimate to the next.
        rate: samples per second [Hz].

    Returns:
        The file.
    """
    path = folder / f"{kind}_{publish_every}_{rate}.yaml"
    every = max(1, round(_CORRECTION * rate))
    text = _TEXT.format(kind=kind, publish_every=publish_every, period=1.0 / rate, every=every)
    path.write_text(text, encoding="utf-8")
    return path
