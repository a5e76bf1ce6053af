"""Every figure of docs/performance.md in one run: some five minutes on a quiet machine.

    python benchmarks/performance.py

writes ``benchmarks/performance.json`` and the pictures ``docs/images/growth.png`` and ``docs/images/peers.png``. It is
``sgms bench`` at full length; give ``--only PART ...`` for a part of it (the JSON file then holds that part alone).
"""

from __future__ import annotations

import sys
from pathlib import Path

from sgms_observer.cli.main import main

ROOT = Path(__file__).resolve().parent.parent
FULL = [
    "bench", "--cold", "--live-seconds", "60", "--replay-seconds", "60",
    "--json", str(ROOT / "benchmarks" / "performance.json"), "--out", str(ROOT / "docs" / "images"), "--overwrite",
]  # fmt: skip

if __name__ == "__main__":
    sys.exit(main([*FULL, *sys.argv[1:]]))
