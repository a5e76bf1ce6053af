"""Eight axes at 1 kHz in one observer node, over the live graph, with a bare relay of the same messages beside it.

    python benchmarks/axes.py --seconds 30

prints the figures of ``sgms bench``'s live run as JSON.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
from pathlib import Path

from sgms_observer.bench.live_run import time_live
from sgms_observer.cli.warn import warn


def main() -> int:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--axes", type=int, default=8)
    parser.add_argument("--rate", type=int, default=1000)
    args = parser.parse_args()
    load = os.getloadavg()[0]
    with tempfile.TemporaryDirectory(prefix="sgms-axes-") as folder:
        live, sentences = time_live(Path(folder), args.seconds, rate=args.rate, axes=args.axes)
    warn(sentences)
    print(json.dumps({"axes": args.axes, "load_at_the_start": load, **live}, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
