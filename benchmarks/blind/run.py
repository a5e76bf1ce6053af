"""Runs ``sgms diagnose`` over a large blind set and prints its figures and the confusion matrix.

    python benchmarks/blind/run.py --seeds report --amount full --workers 2 --out out/blind

Started again with the same arguments it goes on where it stopped. ``--score-only`` prints what there is.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import shutil
import sys
import time
import traceback
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict
from pathlib import Path

import yaml
from plan import AMOUNTS, FIRST_SEED, Case, cases, twin

from sim_plant.blind.case import case_name, make_case, open_seal, paths_of
from sim_plant.blind.score import CaseScore, read_result, score_case
from sim_plant.blind.table import confusion_picture, confusion_text, figures, per_effect_text, table_text

MAIN_DURATION = 30.0  # s


def run_case(case: Case, out: Path, keep_bags: bool) -> str:
    """Make one case, diagnose it, and return one line about it.

    Args:
        case: what to hide.
        out: folder of the set.
        keep_bags: leave the recordings and the report on disk.
    """
    from sgms_observer.cli.main import main

    name = case_name(case.seed, case.effect, case.size)
    paths, result = paths_of(name, out), out / "results" / name
    if (result / "result.json").exists() or (result / "failed.txt").exists():
        return "there already"
    shutil.rmtree(paths.folder, ignore_errors=True)
    shutil.rmtree(result, ignore_errors=True)
    make_case(case.seed, case.effect, case.size, out)
    arguments = ["diagnose", str(paths.bag), "--config", str(paths.config), "--out", str(result), "--holdout"]
    arguments += [*map(str, paths.holdouts), "--workers", "1"]
    spoken = io.StringIO()
    started = time.process_time()  # of this one process, so that other work on the machine does not count
    try:
        with contextlib.redirect_stdout(spoken), contextlib.redirect_stderr(spoken):
            code = main(arguments)
    except BaseException:  # a crash of the workflow is a result too
        code = -1
        spoken.write(traceback.format_exc())
    seconds = time.process_time() - started
    result.mkdir(parents=True, exist_ok=True)
    if code != 0 or not (result / "result.json").exists():
        (result / "failed.txt").write_text(f"exit code {code}\n{spoken.getvalue()}", encoding="utf-8")
    (result / "run.json").write_text(json.dumps(asdict(case) | {"seconds": seconds}) + "\n", encoding="utf-8")
    if not keep_bags:
        for folder in (paths.bag, *paths.holdouts):
            shutil.rmtree(folder)
        (result / "report.html").unlink(missing_ok=True)
    return f"{seconds:.0f} s" if code == 0 else f"FAILED, see {result / 'failed.txt'}"


def twin_gap(case: Case, out: Path) -> float | None:
    """Return the held-out gap with the true effect known: that of the twin without it, in this case's unit.

    Args:
        case: a case with something hidden.
        out: folder of the set.
    """
    name, twin_name = (case_name(one.seed, one.effect, one.size) for one in (case, twin(case)))
    if not (out / "results" / twin_name / "result.json").exists():
        return None
    here = open_seal(paths_of(name, out).truth_file, paths_of(name, out).folder)["effort_rms"][1:]
    there = open_seal(paths_of(twin_name, out).truth_file, paths_of(twin_name, out).folder)["effort_rms"][1:]
    gap = read_result(out / "results" / twin_name).get("gap") or {}
    if gap.get("after") is None:
        return None
    # Exact where every sample has the weight 1, as on these contacts nearly all have.
    ratio = sum(one**2 for one in there) / sum(one**2 for one in here)
    return float(gap["after"]) * ratio**0.5


def read_scores(listed: list[Case], out: Path) -> tuple[list[CaseScore], int]:
    """Return the scores of every case that has a result, and how many failed."""
    scores, failed = [], 0
    for case in listed:
        name = case_name(case.seed, case.effect, case.size)
        result = out / "results" / name
        failed += (result / "failed.txt").exists()
        if not (result / "result.json").exists():
            continue
        truth = open_seal(paths_of(name, out).truth_file, paths_of(name, out).folder)
        seconds = json.loads((result / "run.json").read_text(encoding="utf-8"))["seconds"] * 60.0 / MAIN_DURATION
        floor = twin_gap(case, out) if case.size > 0.0 else None
        tree = yaml.safe_load((result / "augmented.yaml").read_text(encoding="utf-8"))
        mass = tree["/**"]["ros__parameters"]["x"]["mass"]
        scores.append(score_case(truth, read_result(result), floor, seconds, mass))
    return scores, failed


def print_scores(listed: list[Case], out: Path, title: str) -> None:
    """Print the tables, and write them with the confusion matrix into ``out``."""
    scores, failed = read_scores(listed, out)
    if not scores:
        print("no results yet")
        return
    confusion_picture(scores, out / "confusion.png")
    text = "\n\n".join(
        (
            f"# {title}: {len(scores)} of {len(listed)} cases, {failed} failed",
            table_text(figures(scores)),
            per_effect_text(scores),
            "```\n" + confusion_text(scores) + "\n```",
        )
    )
    (out / "figures.md").write_text(text + "\n", encoding="utf-8")
    print(text)


def main() -> int:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", choices=sorted(FIRST_SEED), default="tuning")
    parser.add_argument("--amount", choices=sorted(AMOUNTS), default="quick")
    parser.add_argument("--only", default="", help="only cases with one of these effects (comma-separated)")
    parser.add_argument("--limit", type=int, default=0, help="stop after that many cases; 0 for all")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("out/blind"))
    parser.add_argument("--keep-bags", action="store_true", help="leave recordings and reports on disk")
    parser.add_argument("--score-only", action="store_true", help="run nothing, print what there is")
    args = parser.parse_args()
    out = args.out / args.seeds
    listed = cases(args.seeds, args.amount)
    if args.only:
        listed = [case for case in listed if set(case.effect.split("+")) & set(args.only.split(","))]
    listed = listed[: args.limit or None]
    out.mkdir(parents=True, exist_ok=True)
    if not args.score_only:
        with ProcessPoolExecutor(args.workers) as pool:
            waiting = {pool.submit(run_case, case, out, args.keep_bags): case for case in listed}
            for number, done in enumerate(as_completed(waiting), 1):
                print(f"{number}/{len(listed)} {done.result()}", file=sys.stderr, flush=True)
    print_scores(listed, out, f"{args.seeds} seeds, {args.amount} set")
    return 0


if __name__ == "__main__":
    sys.exit(main())
