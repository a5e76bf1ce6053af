"""Where each number of a filter's two flat arrays lives: ``config`` is fixed, ``state`` evolves."""

from __future__ import annotations

LOWPASS, SAVGOL, KALMAN = range(3)

# config: what every kind knows, then the kind's own from OWN on
KIND, SAMPLE_PERIOD, PERIOD_TOLERANCE, MAXIMUM_GAP, IS_ALIGNED = range(5)
IS_HELD, DELAY_SAMPLES, READY_AFTER, JUMP_SPEED, OWN = range(5, 10)

# state: what every kind remembers, then the kind's own from MEMORY on
HAS_PREVIOUS, STAMP_HIGH, STAMP_LOW, COUNT, MISSING, ORIGIN = range(6)
LATEST_POSITION, LATEST_SPEED, SEEN_HIGH, SEEN_LOW, MEMORY = range(6, 11)

STAMP_SPLIT = 1 << 30

CLOCK_RESET = 1.0
"""Stamps that go back further than this [s] are a clock that was set; less is a sample out of order."""

DENSE = 0.5
"""Samples that follow each other faster than this share of the sample period are too dense."""
