"""Is the first demonstration as good as the tenth? Runs it from an empty kernel cache, and prints each run's figures.

python benchmarks/demo_runs.py --runs 10 --out out/demo_runs

The kernels of these runs are kept in a folder of their own below ``--out``, which must be new: the first run compiles
all of them, as on a new computer. Every figure is read from the run's ``result.json``. Leave the machine alone
meanwhile.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

LOGS = "sgms.log"


def main() -> int:
    """Run the demonstration several times; return 1 if one of the runs failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=10, metavar="N", help="demonstrations, at least 2 (default: 10)")
    parser.add_argument("--duration", type=float, default=20.0, metavar="S", help="time of each (default: 20 s)")
    parser.add_argument("--out", type=Path, default=Path("out/demo_runs"), metavar="DIR", help="a new folder")
    args = parser.parse_args()
    if args.runs < 2:
        parser.error(f"--runs {args.runs} gives nothing to compare; give 2 or more")
    if args.out.exists():
        parser.error(f"{args.out} exists already, and with it perhaps kernels; give a new folder")
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f} at the start, then that of each run's last minute")
    print("run  from start to end   load  late      peak without   peak with    peak smaller  rms smaller")
    found = []
    for number in range(1, args.runs + 1):
        result, seconds = demonstrate(args.out / f"{number:02d}", args.out / "cache", args.duration)
        for axis in result["axes"].values() if result else ({},):
            print(f"{number:3d}  {seconds:16.1f} s  {os.getloadavg()[0]:5.1f}  {row(axis)}", flush=True)
            found.append(axis)
    if not all(found):
        print(f"{sum(not axis for axis in found)} of {args.runs} runs failed; see {LOGS} in their folders")
        return 1
    print(sentence("peak", [ratio(axis, "peak") for axis in found]))
    print(sentence("rms", [ratio(axis, "rms") for axis in found]))
    return 0


def demonstrate(out: Path, cache: Path, duration: float) -> tuple[dict[str, Any], float]:
    """Return result.json of one demonstration, empty if it failed, and how long the command took [s].

    Args:
        out: folder of the results.
        cache: where the kernels are kept.
        duration: time on the graph [s].
    """
    out.mkdir(parents=True)
    command = [sys.executable, "-m", "sgms_observer", "demo", "--out", str(out), "--duration", f"{duration:g}"]
    begun = time.monotonic()
    with (out / LOGS).open("w") as log:
        environment = {**os.environ, "XDG_CACHE_HOME": str(cache.resolve())}
        code = subprocess.run(command, env=environment, stdout=log, stderr=subprocess.STDOUT, check=False).returncode
    seconds = time.monotonic() - begun
    return (json.loads((out / "result.json").read_text()) if code == 0 else {}), seconds


def row(axis: dict[str, Any]) -> str:
    """Return the figures of one axis; what the recording does not tell is a dash."""
    if not axis:
        return "failed"
    before, after = (1e6 * axis["tracking"][f"peak_{when}"] for when in ("before", "after"))
    late = "-" if axis["late_share"] is None else f"{100.0 * axis['late_share']:.3g} %"
    ratios = "".join(f"{ratio(axis, key):11.2f}x" for key in ("peak", "rms"))
    return f"{late:<8}{before:13.3f} um{after:10.3f} um{ratios}"


def ratio(axis: dict[str, Any], key: str) -> float:
    """Return the tracking error without compensation over the one with it."""
    tracking: dict[str, float] = axis["tracking"]
    return tracking[f"{key}_before"] / tracking[f"{key}_after"]


def sentence(key: str, ratios: list[float]) -> str:
    """Return how the first run compares with the later ones."""
    first, later = ratios[0], ratios[1:]
    place = sum(other < first for other in later)
    return (
        f"{key} smaller by: first run {first:.2f}x, later runs {min(later):.2f}x to {max(later):.2f}x;"
        f" the first is better than {place} of {len(later)} later runs"
    )


if __name__ == "__main__":
    sys.exit(main())
