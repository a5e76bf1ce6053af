"""The parameter file that tests of commissioning start from."""

from __future__ import annotations

_START = """/**:
  ros__parameters:
    axes: [x]
    sample_period: 1.0e-3
    x:
      mass: 3.0
      friction: {model: gms, static_force: 6.0}
"""
WINDOW = "filter: {window: 8.0e-3}"


def start_file(*groups: str) -> str:
    """Return the file; further groups of its axis."""
    return _START + "".join(f"      {group}\n" for group in groups)
