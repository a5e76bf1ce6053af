"""Runs ``sgms diagnose`` over plants whose contact is not the observer's, and prints a table with a column per plant.

    python benchmarks/plants/run.py --workers 2 --amount quick --seeds 1000 --out out/plants
    python benchmarks/plants/run.py --plant lugre --plant second --shared ../shared --amount half

Started again with the same arguments it goes on where it stopped: every finished case is a line of
``OUT/results.jsonl``. ``--score-only`` prints what there is. The truth lies in ``OUT/truth`` and is read when all is
done; the folder that the workflow sees does not tell what is hidden, not even by its name.

No constant of the workflow was chosen with these plants, so each column is that of a plant left out.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(Path(__file__).resolve().parent))
sys.path.insert(0, str(ROOT))

import yaml  # noqa: E402
from plant_cases import AMOUNTS, SECOND, Case, cases  # noqa: E402
from plant_files import Files, files_of, make_case  # noqa: E402
from plant_score import Score, score  # noqa: E402
from plant_table import effects_text, table_text  # noqa: E402

from sim_plant.blind.case import open_seal  # noqa: E402
from sim_plant.plants.machine import PLANTS  # noqa: E402

Diagnose = Callable[[Files], dict[str, Any]]
"""Takes the files of a case, writes ``files.result`` and returns exit_code, seconds, memory and message."""


def diagnose_in_process(files: Files) -> dict[str, Any]:
    """Run ``python -m sgms_observer diagnose`` as a process of its own and measure it.

    Args:
        files: of the case.
    """
    command = [sys.executable, "-m", "sgms_observer", "diagnose", str(files.bag), "--config", str(files.config)]
    command += ["--out", str(files.result), "--holdout", str(files.holdout)]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])}
    log = files.folder / "spoken.txt"
    with log.open("wb") as spoken:
        process = subprocess.Popen(command, stdout=spoken, stderr=subprocess.STDOUT, env=environment, cwd=ROOT)
        _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    lines = log.read_text(encoding="utf-8", errors="replace").strip().splitlines()
    return {
        "exit_code": process.returncode,
        "seconds": usage.ru_utime + usage.ru_stime,
        "memory": usage.ru_maxrss / 1024.0,
        "message": "\n".join(lines[-12:]),
    }


def run_case(
    case: Case, out: Path, duration: float, shared: Path | None, keep: bool, diagnose: Diagnose = diagnose_in_process
) -> dict[str, Any]:
    """Make one case, diagnose it, and return its line of the results file.

    Args:
        case: which one.
        out: folder of the benchmark.
        duration: of each recording [s].
        shared: folder that holds ``plants/second_plant.py``.
        keep: leave bags and report on disk.
        diagnose: what runs the workflow.
    """
    files = files_of(case, out)
    shutil.rmtree(files.folder, ignore_errors=True)
    make_case(case, out, duration, shared)
    started = time.monotonic()
    line = {"case": asdict(case)} | diagnose(files) | {"wall": time.monotonic() - started}
    line |= {"result": read_json(files.result / "result.json"), "mass": refitted_mass(files.result / "augmented.yaml")}
    if not keep:
        for path in (files.bag, files.holdout):
            shutil.rmtree(path, ignore_errors=True)
        (files.result / "report.html").unlink(missing_ok=True)
    return line


def read_json(path: Path) -> dict[str, Any] | None:
    """Return a JSON object, or None where there is none.

    Args:
        path: of the file.
    """
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return found if isinstance(found, dict) else None


def refitted_mass(path: Path) -> float | None:
    """Return the mass in an augmented parameter file [kg], or None without one.

    Args:
        path: of the file.
    """
    try:
        return float(yaml.safe_load(path.read_text(encoding="utf-8"))["/**"]["ros__parameters"]["x"]["mass"])
    except (OSError, KeyError, TypeError, ValueError):
        return None


def run_cases(
    listed: Sequence[Case], out: Path, *, workers: int = 1, duration: float = 30.0, shared: Path | None = None,
    keep: bool = False, diagnose: Diagnose = diagnose_in_process,
) -> None:  # fmt: skip
    """Run what is not in the results file yet.

    Args:
        listed: cases.
        out: folder of the benchmark.
        workers: cases at a time.
        duration: of each recording [s].
        shared: folder that holds ``plants/second_plant.py``.
        keep: leave bags and reports on disk.
        diagnose: what runs the workflow; a function of a module when there are several workers.
    """
    out.mkdir(parents=True, exist_ok=True)
    done = {Case(**line["case"]) for line in read_lines(out)}
    waiting = [case for case in listed if case not in done]
    rest = (out, duration, shared, keep, diagnose)
    with (out / "results.jsonl").open("a", encoding="utf-8") as results:
        for number, (case, line) in enumerate(_finished(waiting, workers, rest), 1):
            results.write(json.dumps(line) + "\n")
            results.flush()
            verdict = (line["result"] or {}).get("verdict", f"exit code {line['exit_code']}, see spoken.txt")
            code = files_of(case, out).folder.name
            print(f"{number}/{len(waiting)} {code}: {verdict}, {line['seconds']:.0f} s", file=sys.stderr, flush=True)


def _finished(waiting: Sequence[Case], workers: int, rest: tuple[Any, ...]) -> Iterator[tuple[Case, dict[str, Any]]]:
    """Yield each case with its line as it is done; a single worker is this process."""
    if workers == 1:
        for case in waiting:
            yield case, run_case(case, *rest)
        return
    with ProcessPoolExecutor(workers) as pool:
        jobs = {pool.submit(run_case, case, *rest): case for case in waiting}
        for job in as_completed(jobs):
            yield jobs[job], job.result()


def read_lines(out: Path) -> list[dict[str, Any]]:
    """Return the lines of the results file; a line that was cut off is left out.

    Args:
        out: folder of the benchmark.
    """
    path = out / "results.jsonl"
    lines = []
    for text in path.read_text(encoding="utf-8").splitlines() if path.exists() else ():
        try:
            lines.append(json.loads(text))
        except ValueError:
            continue
    return lines


def read_scores(listed: Sequence[Case], out: Path) -> list[Score]:
    """Open the seals and score every case that has run.

    Args:
        listed: cases.
        out: folder of the benchmark.
    """
    lines = {Case(**line["case"]): line for line in read_lines(out)}
    scores = []
    for case in listed:
        if case in lines:
            files = files_of(case, out)
            scores.append(score(open_seal(files.truth, files.folder), lines[case]))
    return scores


def print_scores(listed: Sequence[Case], out: Path) -> None:
    """Print the tables and write them to ``figures.md``.

    Args:
        listed: cases.
        out: folder of the benchmark.
    """
    scores = read_scores(listed, out)
    if not scores:
        print("no results yet")
        return
    text = f"{len(scores)} of {len(listed)} cases\n\n{table_text(scores)}\n\n{effects_text(scores)}\n"
    (out / "figures.md").write_text(text, encoding="utf-8")
    print(text)


def main() -> int:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--plant", action="append", choices=[*PLANTS, SECOND], help="a plant; may be repeated (default: all but second)"
    )
    parser.add_argument("--amount", choices=sorted(AMOUNTS), default="quick")
    parser.add_argument("--seeds", type=int, default=0, metavar="FIRST", help="first seed")
    parser.add_argument("--only", default="", help="only these hidden effects (comma-separated; nothing for none)")
    parser.add_argument("--limit", type=int, default=0, help="at most that many cases of each plant; 0 for all")
    parser.add_argument("--workers", type=int, default=1, help="cases at a time")
    parser.add_argument("--duration", type=float, default=30.0, help="of each recording [s]")
    parser.add_argument("--shared", type=Path, help="folder that holds plants/second_plant.py (default: ../shared)")
    parser.add_argument("--out", type=Path, default=Path("out/plants"))
    parser.add_argument("--keep", action="store_true", help="leave bags and reports on disk")
    parser.add_argument("--score-only", action="store_true", help="run nothing, print what there is")
    args = parser.parse_args()
    listed: list[Case] = []
    for plant in args.plant or list(PLANTS):
        own = cases(plant, args.amount, args.seeds)
        if args.only:
            own = [case for case in own if case.effect in args.only.split(",")]
        listed += own[: args.limit or None]
    if not args.score_only:
        run_cases(listed, args.out, workers=args.workers, duration=args.duration, shared=args.shared, keep=args.keep)
    print_scores(listed, args.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
