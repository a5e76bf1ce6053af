"""Parameter files of the runs that go through the command line and the graph."""

from __future__ import annotations

from pathlib import Path

_TEXT = """/**:
  ros__parameters:
    axes: [x]
    sample_period: 1.0e-4        # s
    publish_every: {publish_every}
    x:
      mass: 10.0                 # kg
      estimator: {{kind: {kind}, parameters: [kappa]}}
      stage: {{reference: {{kind: sine, amplitude: 200.0e-6, frequency: 5.0}}}}
"""


def write_config(folder: Path, kind: str, publish_every: int = 1) -> Path:
    """Write a parameter file: one axis at 10 kHz, Table I, the default filter, the stiffness estimated.

    Args:
        folder: where to.
        kind: of the estimator, ``ekf`` or ``mhe``.
        publish_every: samples from one published estimate to the next.

    Returns:
        The file.
    """
    path = folder / f"{kind}_{publish_every}.yaml"
    path.write_text(_TEXT.format(kind=kind, publish_every=publish_every), encoding="utf-8")
    return path
