"""Says how the rates of the benchmark over plants move when one criterion moves by a factor of two.

    python benchmarks/plants/sensitivity.py --out out/plants

Reads the tests that every result holds, with value and threshold, and decides them anew with one criterion halved or
doubled; nothing is fitted again. So it sees names that come or go, not what later rounds would do about it.
"""

from __future__ import annotations

import argparse
import copy
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(Path(__file__).resolve().parent))
sys.path.insert(0, str(ROOT))

from plant_cases import Case  # noqa: E402
from plant_files import files_of  # noqa: E402
from plant_score import Score, score  # noqa: E402
from run import read_lines  # noqa: E402
from scipy import stats  # noqa: E402

from sgms_observer.diagnosis.criteria import Criteria  # noqa: E402
from sgms_observer.effects.catalogue import names as catalogue_names  # noqa: E402
from sim_plant.blind.case import open_seal  # noqa: E402

CRITERION_OF = {
    "z-score on data not fitted to": "min_z_score",
    "z-score over all recordings": "min_z_score",
    "strength over its standard error": "min_z_score",
    "strength over its scatter": "min_z_score",
    "strength over its error with any significant scatter": "interval_z_score",
    "share that is surely predicted better": "min_predictable_share",
    "z-score beside the other effects": "min_z_score",
    "z-score of a better prediction than": "min_z_score",
    "z-score beside its rival": "min_z_score",
    "z-score of all effects over the position": "min_z_score",
    "z-score beside another contact law": "min_z_score",
    "size beyond the tolerance of the file": "interval_z_score",
    "held-out gap: z-score": "interval_z_score",
    "gap of the written model: z-score": "interval_z_score",
    "gap of the written model: share of": "min_closed_share",
    "gap beside the others: z-score": "interval_z_score",
    "z-score of a force that differs between": "min_z_score",
    "share of the squared gap above the noise in the place of": "min_imitable_share",
    "share of the squared gap above the noise beside the others, of": "min_imitable_share",
    "share of the squared residual beside logarithmic friction": "min_imitable_share",
    "share of the closable squared gap": "min_closed_share",
    "frequency over sample rate": "max_rate_share",
    "share of samples beyond the limit": "max_unexplained",
    "share of the effort that is unexplained": "max_unexplained",
    "unexplained share of the effort": "max_unexplained",
    "surely predictable share": "min_predictable_share",
    "share of the squared gap that the refit adds": "min_predictable_share",
    "gap over noise": "max_gap_over_noise",
    "residual over noise, where the contact slides fast": "max_sliding_over_noise",
    "share of the squared gap, where the contact slides fast": "min_predictable_share",
    "residual above noise / closed residual": "min_imitable_share",
    "share of what it closes that it surely closes beside a map": "min_imitable_share",
    "share of a constant force that acts": "min_imitable_share",
    "share of the squared gap that another load": "min_imitable_share",
    "share of the delay": "min_imitable_share",
    "smallest likely share of the delay": "min_imitable_share",
    "squared difference / (difference": "min_imitable_share",
}
"""Which criterion a test belongs to, by the beginning of its name."""
FROM_OUTSIDE = "where the contact slides fast"
"""Part of the names of two tests: where both fail, a force acts that does not repeat."""
COMPARISONS = ("z-score of a better prediction than ", "squared difference / (difference")
"""Beginnings of the tests of an effect against its rivals: one that fails makes an alternative, and takes no name."""
FACTORS = (0.5, 2.0)
Tested = dict[str, Any]


def passes(test: Tested, criterion: str, factor: float) -> bool:
    """Return the outcome of a test with its criterion moved.

    Args:
        test: of result.json.
        criterion: the one that moves; any other test keeps its outcome.
        factor: by which it moves.
    """
    own = next((name for start, name in CRITERION_OF.items() if test["name"].startswith(start)), None)
    if own != criterion or test["value"] is None:
        return bool(test["passed"])
    threshold = moved(test["threshold"], factor) if criterion == "min_z_score" else factor * test["threshold"]
    is_lower_limit = (test["value"] >= test["threshold"]) == bool(test["passed"])
    return bool(test["value"] >= threshold if is_lower_limit else test["value"] <= threshold)


def moved(threshold: float, factor: float) -> float:
    """Return a z-score threshold, raised for several trials or not, for the criterion moved by a factor.

    Args:
        threshold: as it was used.
        factor: on ``min_z_score``.
    """
    single = Criteria().min_z_score
    if threshold <= 0.0:
        return factor * threshold
    trials = stats.norm.sf(single) / stats.norm.sf(threshold)
    return float(stats.norm.isf(min(0.5, stats.norm.sf(factor * single) / max(1.0, trials))))


def hypotheses(tests: Sequence[Tested]) -> Iterator[tuple[str, list[Tested]]]:
    """Yield each hypothesis of each round with its tests, those of the whole model last.

    Args:
        tests: of result.json, in its order.
    """
    group: list[Tested] = []
    for test in tests:
        if group and (test["of"] != group[0]["of"] or test["name"] == group[0]["name"]):
            yield group[0]["of"], group
            group = []
        group.append(test)
    if group:
        yield group[0]["of"], group


def decided(result: dict[str, Any], criterion: str, factor: float) -> dict[str, Any]:
    """Return a result with its names and verdict decided anew.

    Args:
        result: result.json.
        criterion: the one that moves.
        factor: by which it moves.
    """
    again = copy.deepcopy(result)
    outcome: dict[str, bool] = {}
    whole: list[Tested] = []
    for name, group in hypotheses(result["tests"]):
        if name == "model":
            whole = group
        elif name in catalogue_names():
            holds = all(passes(test, criterion, factor) for test in group if not rival_of(test))
            outcome[name] = outcome.get(name, False) or holds
    was = [entry["name"] for entry in result["effects"]]
    again["effects"] = [entry for entry in again["effects"] if outcome.get(entry["name"], True)]
    for entry in again["effects"]:
        compared = [test for test in result["tests"] if test["of"] == entry["name"] and rival_of(test)]
        is_better = {rival_of(test): passes(test, criterion, factor) for test in compared}
        rivals = dict.fromkeys([*entry["alternatives"], *is_better])
        entry["alternatives"] = [rival for rival in rivals if not is_better.get(rival, False)]
    tested = {name for name, group in hypotheses(result["tests"]) if all(test["passed"] for test in group)}
    fresh = [name for name, holds in outcome.items() if holds and name not in was and name not in tested]
    again["effects"] += [{"name": name, "alternatives": [], "parameters": {}} for name in fresh]
    has_moved = any(passes(test, criterion, factor) != test["passed"] for test in whole)
    if again["effects"]:
        has_alternatives = any(entry["alternatives"] for entry in again["effects"])
        again["verdict"] = "ambiguous" if has_alternatives else "effect_found"
    elif was or has_moved:
        again["verdict"] = verdict_without_names(whole, bool(result["learnt"]), criterion, factor)
    return again


def rival_of(test: Tested) -> str:
    """Return the effect that a test compares a named one with, which becomes an alternative; empty for other tests."""
    rival = str(test["name"]).rsplit(" ", 1)[-1]
    return rival if test["name"].startswith(COMPARISONS) and rival in catalogue_names() else ""


def verdict_without_names(whole: Sequence[Tested], is_learnt: bool, criterion: str, factor: float) -> str:
    """Return the verdict where nothing has a name, by the order of ``diagnosis.answer.verdict_of``.

    Args:
        whole: tests of the model.
        is_learnt: whether a map was learnt.
        criterion: the one that moves.
        factor: by which it moves.
    """
    passed = {test["name"]: passes(test, criterion, factor) for test in whole}
    outside = [name for name in passed if FROM_OUTSIDE in name]
    predictable = [name for name in passed if name.startswith("surely predictable")]
    unexplained = [name for name in passed if name.startswith("share of the effort")]
    if not is_learnt and not all(passed[name] for name in unexplained):
        return "cannot_tell"
    if (outside and not any(passed[name] for name in outside)) or not all(passed[name] for name in predictable):
        return "unknown_effect"
    others = [name for name in passed if name not in (*outside, *predictable)]
    return "no_effect" if all(passed[name] for name in others) else "cannot_tell"


def rates(scores: Sequence[Score]) -> str:
    """Return the cells of one row: false alarms, right name first, in the set, confidently wrong, unknown told.

    Args:
        scores: of all cases.
    """
    empty = [one for one in scores if not one.effect]
    inside = [one for one in scores if one.effect and one.is_inside]
    outside = [one for one in scores if one.effect and not one.is_inside and one.is_repeatable]
    cells = (
        [one.is_alarm and not one.is_borne_out for one in empty],
        [one.is_right_first for one in inside],
        [one.is_in_set for one in inside],
        [one.is_wrong for one in scores],
        [one.is_told_unknown for one in outside],
    )
    return " | ".join(f"{sum(flags)}/{len(flags)}" if flags else "-" for flags in cells)


def main() -> int:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, action="append", help="folder of a benchmark; may be repeated")
    args = parser.parse_args()
    cases = []
    for out in args.out or [Path("out/plants")]:
        for line in read_lines(out):
            if line.get("result"):
                files = files_of(Case(**line["case"]), out)
                cases.append((open_seal(files.truth, files.folder), line))
    print(f"{len(cases)} cases\n")
    print("| criterion | factor | false alarms | right name first | truth in the set | wrong | unknown told |")
    print("|---|---|---|---|---|---|---|")
    print(f"| as it is | 1 | {rates([score(truth, line) for truth, line in cases])} |")
    for criterion in dict.fromkeys(CRITERION_OF.values()):
        for factor in FACTORS:
            found = [
                score(truth, line | {"result": decided(line["result"], criterion, factor)}) for truth, line in cases
            ]
            print(f"| {criterion} | {factor:g} | {rates(found)} |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
