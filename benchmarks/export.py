"""Times one sample of the observer: the exported C (EKF) beside the compiled Python path with the same settings.

    python benchmarks/export.py [--config config/paper.yaml] [--compiler gcc] [--times 200]

Both take the samples of the shipped test vector, one at a time. Of each sample the fastest of all runs counts, so that
what else the machine does is left out; the worst of these over all samples is the worst case of the code. The C is
built with the flags of its Makefile, as double and as float.
"""

from __future__ import annotations

import argparse
import subprocess
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from sgms_observer.export.c_target import c_files, vector_samples, with_ekf
from sgms_observer.observer.axis_observer import AxisObserver
from sgms_observer.observer.samples import Samples
from sgms_observer.settings.axis import AxisSettings
from sgms_observer.settings.load import load_settings


def c_line(folder: Path, compiler: str, real: str, times: int) -> str:
    """Build the folder's test and return its line with the times."""
    make = ["make", "-s", "-B", "-C", str(folder), "test", f"CC={compiler}", f"REAL={real}"]
    subprocess.run(make, check=True, capture_output=True)
    done = subprocess.run(["./test_sgms", "--time", str(times)], cwd=folder, check=True, capture_output=True, text=True)
    (line,) = [line for line in done.stdout.splitlines() if line.startswith("time ")]
    return line.split(" ", 2)[2]


def python_line(axis: AxisSettings, sample_period: float, times: int) -> str:
    """Return the same of ``AxisObserver.step``, called with one sample at a time as a node does."""
    samples = vector_samples(axis, sample_period)
    count = len(samples.stamp_ns)
    rows = [
        Samples(*(getattr(samples, name)[k : k + 1] for name in Samples.__dataclass_fields__)) for k in range(count)
    ]
    best = np.full(count, np.inf)
    for _ in range(times + 1):
        observer = AxisObserver(axis, sample_period)
        for k, row in enumerate(rows):
            start = time.perf_counter_ns()
            observer.step(row)
            best[k] = min(best[k], time.perf_counter_ns() - start)
    return f"median {np.median(best):.0f} ns, 99 % {np.quantile(best, 0.99):.0f} ns, worst {best.max():.0f} ns"


def main() -> None:
    """Print one line for each way to run a sample."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--config", default=str(Path(__file__).resolve().parent.parent / "config" / "paper.yaml"))
    parser.add_argument("--compiler", default="gcc")
    parser.add_argument("--times", type=int, default=200)
    args = parser.parse_args()
    settings = load_settings(args.config)
    axis = with_ekf(settings.axes[0])[0]
    with tempfile.TemporaryDirectory() as room:
        for name, text in c_files(settings, (axis,), "double")[0].items():
            (Path(room) / name).write_text(text, encoding="utf-8")
        for real in ("double", "float"):
            print(f"C, {args.compiler}, {real}: {c_line(Path(room), args.compiler, real, args.times)}", flush=True)
    axis = replace(axis, compensation=replace(axis.compensation, enabled=True))
    print(f"Python, one sample a call: {python_line(axis, settings.sample_period, max(3, args.times // 20))}")


if __name__ == "__main__":
    main()
