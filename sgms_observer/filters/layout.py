"""Where each number of a filter's two flat arrays lives: ``config`` is fixed, ``state`` evolves."""

from __future__ import annotations

LOWPASS = 0
SAVGOL = 1
KALMAN = 2

# config: what every kind knows, then the kind's own from OWN on
KIND = 0
SAMPLE_PERIOD = 1
PERIOD_TOLERANCE = 2
MAXIMUM_GAP = 3
IS_ALIGNED = 4
IS_HELD = 5
DELAY_SAMPLES = 6
READY_AFTER = 7
JUMP_SPEED = 8
OWN = 9

# state: what every kind remembers, then the kind's own from MEMORY on
HAS_PREVIOUS = 0
STAMP_HIGH = 1
STAMP_LOW = 2
COUNT = 3
MISSING = 4
ORIGIN = 5
LATEST_POSITION = 6
LATEST_SPEED = 7
SEEN_HIGH = 8
SEEN_LOW = 9
MEMORY = 10

STAMP_SPLIT = 1 << 30

CLOCK_RESET = 1.0
"""Stamps that go back further than this [s] are a clock that was set; less is a sample out of order."""

DENSE = 0.5
"""Samples that follow each other faster than this share of the sample period are too dense."""
