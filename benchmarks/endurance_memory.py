"""Resident memory of a process over a long run."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

_SETTLED = 0.1  # share of the run after which memory should not grow any more


class Memory:
    """Looks at the resident memory of a process, again and again.

    Args:
        process_id: of the process; by default this one.
    """

    def __init__(self, process_id: int | None = None) -> None:
        self._file = Path(f"/proc/{process_id or 'self'}/statm")
        self._megabytes: list[float] = []

    def look(self) -> None:
        """Note how much it is now."""
        pages = int(self._file.read_text().split()[1])
        self._megabytes.append(pages * os.sysconf("SC_PAGE_SIZE") / 2**20)

    def figures(self) -> dict[str, float]:
        """Return what was seen [MB]: at a tenth of the run, at the end, at most, and a line's growth from the tenth on.

        Returns:
            Name to megabytes.
        """
        settled = self._megabytes[int(len(self._megabytes) * _SETTLED) :]
        slope = float(np.polyfit(np.arange(len(settled)), settled, 1)[0]) if len(settled) > 2 else 0.0
        return {
            "settled": settled[0],
            "at_the_end": settled[-1],
            "largest": max(settled),
            "growth_of_a_line_through_it": slope * len(settled),
        }
