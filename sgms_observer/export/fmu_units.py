"""Units as FMI wants them: exponents of the SI base units."""

from __future__ import annotations

import re

_BASE = {
    "m": {"m": 1},
    "s": {"s": 1},
    "kg": {"kg": 1},
    "rad": {"rad": 1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "Hz": {"s": -1},
}


def base_exponents(unit: str) -> dict[str, int]:
    """Return the exponent of each base unit in a unit such as ``N s/m``.

    Args:
        unit: factors separated by spaces; what follows the first slash is below it.
    """
    found: dict[str, int] = {}
    for part, sign in zip(re.split("/", unit, maxsplit=1), (1, -1), strict=False):
        for word in re.split(r"[ /()]+", part.strip()):
            match = re.fullmatch(r"([A-Za-z]+)(?:\^(-?\d+))?", word)
            if match is None or match[1] not in _BASE:
                continue
            for base, exponent in _BASE[match[1]].items():
                found[base] = found.get(base, 0) + sign * exponent * int(match[2] or 1)
    return {base: exponent for base, exponent in found.items() if exponent}
