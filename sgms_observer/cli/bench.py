"""``sgms bench``: run times of the estimators and of other solvers, and the latency of live runs."""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import platform
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sgms_observer.cli.compile import compile_or_warn
from sgms_observer.cli.options import add_output_options, add_overwrite_option
from sgms_observer.cli.warn import warn
from sgms_observer.outcome import json_value

if TYPE_CHECKING:
    from sgms_observer.cli.progress import Progress

HELP = (
    "measure run times of the estimators and of other solvers, and the latency of live runs, compared with a relay node"
    " that computes nothing"
)

PARTS = ("speed", "accuracy", "peers", "growth", "start", "replay", "live")
_NEED_CASADI = ("accuracy", "peers")
_ELEMENTS = (2, 4, 8, 16, 32)
_HORIZONS = (2, 4, 8, 16, 32, 64, 128)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments, as ``main.Command``."""
    parser.add_argument("--json", metavar="FILE", help="write every figure to this file")
    parser.add_argument("--out", metavar="DIR", help="folder of the pictures")
    parser.add_argument(
        "--only", nargs="+", choices=PARTS, default=PARTS, metavar="PART", help=f"run these parts: {', '.join(PARTS)}"
    )
    parser.add_argument("--windows", type=int, default=397, metavar="N", help="windows to time (default: 397)")
    parser.add_argument(
        "--live-seconds", type=float, default=5.0, metavar="S", help="length of the live run [s] (default: 5; full: 60)"
    )
    parser.add_argument(
        "--replay-seconds", type=float, default=15.0, metavar="S",
        help="length of the replayed recording [s] (default: 15; full: 60)",
    )  # fmt: skip
    parser.add_argument(
        "--publish-every", type=int, default=1, metavar="N", help="live: publish every n-th estimate (default: 1)"
    )
    parser.add_argument("--cold", action="store_true", help="also time a first-ever start, which compiles everything")
    add_overwrite_option(parser)
    add_output_options(parser, has_result=False)


def run(args: argparse.Namespace) -> int:
    """Do the job, as ``main.Command``."""
    from sgms_observer.cli.progress import Progress
    from sgms_observer.errors import ConfigurationError
    from sgms_observer.whole_file import refuse_existing_files, try_folder

    limits = {"windows": (1, 100_000), "live_seconds": (0.5, 3600), "replay_seconds": (0.5, 3600)}
    faults = [
        f"--{name.replace('_', '-')} = {getattr(args, name):g} must be between {low} and {high}; choose a value there"
        for name, (low, high) in limits.items()
        if not low <= getattr(args, name) <= high
    ]
    if args.publish_every < 1:
        faults.append(f"--publish-every = {args.publish_every} must be at least 1; give 1 for every estimate")
    if faults:
        raise ConfigurationError(faults)
    if args.json:
        refuse_existing_files([args.json], args.overwrite)
        try_folder(Path(args.json).parent)
    if args.out:
        try_folder(args.out)
    result = _empty()
    with tempfile.TemporaryDirectory(prefix="sgms-bench-") as folder:
        chosen = [part for part in PARTS if part in args.only and _can_run(part)]
        if "live" in chosen:
            compile_or_warn()
        for number, part in enumerate(chosen):
            with Progress(f"bench: {part}", len(chosen)) as progress:
                _tell(part, progress, number)
                _RUN[part](args, result, Path(folder))
    text = json.dumps(json_value(result), indent=1, allow_nan=False)
    if args.json:
        from sgms_observer.whole_file import write_text

        write_text(text + "\n", args.json)
        print(f"wrote {args.json}")
    else:
        print(text)
    if args.out:
        from sgms_observer.bench.pictures import draw

        for picture in draw(result, Path(args.out)):
            print(picture)
    return 0


def machine() -> str:
    """Return a sentence about the machine: processor, cores, load, Python and the numerical libraries."""
    import numpy as np

    from sgms_observer.jit import HAS_NUMBA

    processor = platform.processor() or platform.machine()
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        processor = next(line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        pass
    load = f", load {os.getloadavg()[0]:.1f} at the start" if hasattr(os, "getloadavg") else ""
    numba = "no numba"
    if HAS_NUMBA:
        import numba as library

        numba = f"numba {library.__version__}"
    casadi = "no casadi"
    if _has_casadi():
        from casadi import CasadiMeta

        casadi = f"casadi {CasadiMeta.version()}"
    return (
        f"{processor}, {os.cpu_count()} cores{load}, {platform.system()}, Python {platform.python_version()},"
        f" numpy {np.__version__}, {numba}, {casadi}"
    )


def _has_casadi() -> bool:
    return importlib.util.find_spec("casadi") is not None


def _can_run(part: str) -> bool:
    """Return whether the libraries of a part are installed; warn of a missing one."""
    if part not in _NEED_CASADI or _has_casadi():
        return True
    warn([f"bench leaves out {part}, because CasADi is not installed; install it with: pip install casadi"])
    return False


def _empty() -> dict[str, Any]:
    """Return the result's shape, with nothing measured."""
    return {
        "machine": machine(),
        "mhe_rti_us": None,
        "mhe_rti_with_arrival_us": None,
        "ekf_predict_us": None,
        "peers_us": {"do_mpc": None, "casadi_sqpmethod": None, "casadi_ipopt": None},
        "peers_difference_n": {},
        "force_error_rms_n": {"one_iteration": None, "two_iterations": None},
        "growth": {"n_z": [], "horizon": [], "slope": {"n_z": None, "horizon": None}},
        "start_s": None,
        "replay": None,
        "live": None,
    }


def _tell(part: str, progress: Progress, number: int) -> None:
    """Show which part begins: by a bar over the parts on a terminal, by a line in a pipe."""
    if sys.stderr.isatty():
        progress.show(number)
    else:
        print(f"bench: {part} ...", file=sys.stderr, flush=True)


def _speed(args: argparse.Namespace, result: dict[str, Any], folder: Path) -> None:
    from sgms_observer.bench.problem import make_problem
    from sgms_observer.bench.timing import time_estimator

    timings = time_estimator(make_problem(windows=args.windows))
    result["ekf_predict_us"] = vars(timings.predict)
    result["mhe_rti_us"] = vars(timings.iteration)
    result["mhe_rti_with_arrival_us"] = vars(timings.with_arrival)


def _accuracy(args: argparse.Namespace, result: dict[str, Any], folder: Path) -> None:
    from sgms_observer.bench.accuracy import accuracy
    from sgms_observer.bench.problem import make_problem

    problem = make_problem(windows=args.windows)
    one = accuracy(problem, 1, ipopt_every=max(1, args.windows // 10))
    two = accuracy(problem, 2)
    result["force_error_rms_n"] = {
        "one_iteration": one.rms,
        "two_iterations": two.rms,
        "largest_one_iteration": one.largest,
        "largest_two_iterations": two.largest,
        "instants": one.instants,
        "converged_from_ipopt_largest": one.ipopt_largest if one.ipopt_instants else None,
        "ipopt_instants": one.ipopt_instants,
    }


def _peers(args: argparse.Namespace, result: dict[str, Any], folder: Path) -> None:
    from sgms_observer.bench.peers import time_peers
    from sgms_observer.bench.problem import make_problem

    found, sentences = time_peers(make_problem(windows=args.windows))
    warn(sentences)
    result["peers_us"] |= {name: vars(peer.timing) if peer else None for name, peer in found.items()}
    result["peers_difference_n"] = {name: peer.difference for name, peer in found.items() if peer}


def _growth(args: argparse.Namespace, result: dict[str, Any], folder: Path) -> None:
    from sgms_observer.bench.timing import slope, time_growth

    pairs = {name: time_growth(sizes, name) for name, sizes in (("n_z", _ELEMENTS), ("horizon", _HORIZONS))}
    result["growth"] = {**pairs, "slope": {name: slope(values) for name, values in pairs.items()}}


def _start(args: argparse.Namespace, result: dict[str, Any], folder: Path) -> None:
    from sgms_observer.bench.replay import time_start

    result["start_s"] = time_start(folder, args.cold)


def _replay(args: argparse.Namespace, result: dict[str, Any], folder: Path) -> None:
    from sgms_observer.bench.replay import time_replay

    result["replay"] = time_replay(folder, args.replay_seconds)


def _live(args: argparse.Namespace, result: dict[str, Any], folder: Path) -> None:
    if importlib.util.find_spec("rclpy") is None:
        print("rclpy is not installed, so there is no live run: pip install 'sgms_observer[ros]'", file=sys.stderr)
        return
    from sgms_observer.bench.live_run import RATES, time_live

    runs = []
    for rate in RATES:
        figures, sentences = time_live(folder, args.live_seconds, args.publish_every, rate)
        warn(sentences)
        runs.append(figures)
    result["live"] = {**runs[-1], "rates": runs[:-1]}


_RUN = {
    "speed": _speed,
    "accuracy": _accuracy,
    "peers": _peers,
    "growth": _growth,
    "start": _start,
    "replay": _replay,
    "live": _live,
}
