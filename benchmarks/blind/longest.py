"""Times ``sgms diagnose`` on recordings of 60 s, two workers: the cases that took longest in a blind set, made anew.

    python benchmarks/blind/longest.py --seeds report --amount report --out out/blind --cases 3

Run it on a quiet machine after ``benchmarks/blind/run.py`` with the same arguments.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from plan import AMOUNTS, FIRST_SEED, Case, cases

from sim_plant.blind.case import case_name, make_case

DURATION = 60.0
"""Length of the recording to learn from [s]; two of 12 s to judge on come with it."""


def seconds_of(case: Case) -> tuple[float, str]:
    """Return how long the diagnosis of one case took by the clock on the wall [s], and its verdict.

    Args:
        case: what to hide.
    """
    with tempfile.TemporaryDirectory() as folder:
        paths = make_case(case.seed, case.effect, case.size, Path(folder), duration=DURATION)
        out = Path(folder) / "result"
        command = [sys.executable, "-m", "sgms_observer", "diagnose", str(paths.bag), "--config", str(paths.config)]
        command += ["--out", str(out), "--workers", "2", "--holdout", *map(str, paths.holdouts)]
        started = time.monotonic()
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        seconds = time.monotonic() - started
        return seconds, str(json.loads((out / "result.json").read_text(encoding="utf-8"))["verdict"])


def main() -> int:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", choices=sorted(FIRST_SEED), default="tuning")
    parser.add_argument("--amount", choices=sorted(AMOUNTS), default="quick")
    parser.add_argument("--cases", type=int, default=3, help="how many of the slowest")
    parser.add_argument("--out", type=Path, default=Path("out/blind"))
    args = parser.parse_args()
    taken = []
    for case in cases(args.seeds, args.amount):
        file = args.out / args.seeds / "results" / case_name(case.seed, case.effect, case.size) / "run.json"
        if file.exists():
            taken.append((json.loads(file.read_text(encoding="utf-8"))["seconds"], case))
    if not taken:
        print(f"no results in {args.out / args.seeds}; run benchmarks/blind/run.py first")
        return 1
    for there, case in sorted(taken, key=lambda item: -item[0])[: args.cases]:
        seconds, verdict = seconds_of(case)
        print(
            f"seed {case.seed}, {case.effect} {case.size:g}: {there:.0f} s on one core in the set (30 s of recording);"
            f" {seconds:.0f} s by the clock for {DURATION:.0f} s of recording, two workers ({verdict})",
            flush=True,
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
