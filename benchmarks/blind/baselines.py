"""The same blind data through least squares + BIC and through pysindy, in the same scoring, side by side.

    python benchmarks/blind/baselines.py --seeds report --amount full --workers 2 --out out/blind

pysindy is optional (``pip install '.[bench]'``); without it only the other baseline runs. The results of
``benchmarks/blind/run.py`` in the same folder are printed beside them.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import shutil
import sys
import tempfile
import time
import warnings
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

import least_squares_bic
import library
import sparse_regression
from plan import AMOUNTS, FIRST_SEED, Case, cases, twin
from run import read_scores

from sim_plant.blind.case import case_name, make_case
from sim_plant.blind.score import CaseScore, score_case
from sim_plant.blind.table import figures, per_effect_text

METHODS = {"least squares + BIC": least_squares_bic, "pysindy STLSQ": sparse_regression}


def run_case(case: Case, out: Path) -> None:
    """Make one case, put it through every baseline, and keep truth and results.

    Args:
        case: what to hide.
        out: folder of the set's baselines.
    """
    file = out / f"{case_name(case.seed, case.effect, case.size)}.json"
    if file.exists():
        return
    warnings.filterwarnings("ignore")
    folder = Path(tempfile.mkdtemp())
    try:
        paths = make_case(case.seed, case.effect, case.size, folder)
        main = library.read_signals(paths.bag, paths.config)
        holdouts = [library.read_signals(path, paths.config) for path in paths.holdouts]
        listed = library.pool(main)
        answers = {}
        for name, method in METHODS.items():
            if method is sparse_regression and importlib.util.find_spec("pysindy") is None:
                continue
            started = time.process_time()
            answers[name] = method.diagnose(main, holdouts, listed) | {"seconds": time.process_time() - started}
        truth = json.loads(paths.truth_file.read_text(encoding="utf-8"))
        file.write_text(json.dumps({"truth": truth, "answers": answers}), encoding="utf-8")
    finally:
        shutil.rmtree(folder)


def scores_of(method: str, listed: list[Case], out: Path) -> list[CaseScore]:
    """Return the scores of one baseline; the floor of a gap is that of the twin without the effect."""
    scores = []
    for case in listed:
        file, other = (out / f"{case_name(one.seed, one.effect, one.size)}.json" for one in (case, twin(case)))
        if not file.exists():
            continue
        kept = json.loads(file.read_text(encoding="utf-8"))
        if method not in kept["answers"]:
            continue
        answer = kept["answers"][method]
        floor = None
        if case.size > 0.0 and other.exists():
            pair = json.loads(other.read_text(encoding="utf-8"))
            squares = [sum(x**2 for x in one["truth"]["effort_rms"][1:]) for one in (pair, kept)]
            floor = pair["answers"][method]["gap"]["before"] * (squares[0] / squares[1]) ** 0.5
        scores.append(score_case(kept["truth"], answer, floor, answer["seconds"] * 2.0))
    return scores


def main() -> int:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", choices=sorted(FIRST_SEED), default="tuning")
    parser.add_argument("--amount", choices=sorted(AMOUNTS), default="quick")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--limit", type=int, default=0)
    parser.add_argument("--out", type=Path, default=Path("out/blind"))
    args = parser.parse_args()
    listed = cases(args.seeds, args.amount)[: args.limit or None]
    ours, out = args.out / args.seeds, args.out / args.seeds / "baselines"
    out.mkdir(parents=True, exist_ok=True)
    with ProcessPoolExecutor(args.workers) as pool:
        waiting = [pool.submit(run_case, case, out) for case in listed]
        for number, done in enumerate(as_completed(waiting), 1):
            done.result()
            print(f"{number}/{len(listed)}", file=sys.stderr, flush=True)
    columns = {name: scores_of(name, listed, out) for name in METHODS}
    columns = {"sgms diagnose": read_scores(listed, ours)[0]} | columns
    columns = {name: scores for name, scores in columns.items() if scores}
    lines = {name: figures(scores) for name, scores in columns.items()}
    text = ["| figure | to reach | " + " | ".join(lines) + " |", "|---|---|" + "---|" * len(lines)]
    for row in zip(*lines.values(), strict=True):
        text.append(f"| {row[0].name} | {row[0].target} | " + " | ".join(one.value for one in row) + " |")
    (out / "figures.md").write_text("\n".join(text) + "\n", encoding="utf-8")
    print("\n".join(text))
    for name, scores in columns.items():
        (out / f"{name.replace(' ', '_').replace('+', 'and')}.md").write_text(
            per_effect_text(scores) + "\n", encoding="utf-8"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
