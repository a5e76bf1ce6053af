"""The benchmark over plants: which cases, what the workflow may see, and the scoring on results made by hand."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Any

import pytest

from sgms_observer.jit import HAS_NUMBA
from sgms_observer.settings.load import load_settings
from sim_plant.plants.effects import KINDS
from sim_plant.plants.machine import PLANTS

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "benchmarks" / "plants"))

from plant_cases import AMOUNTS, NOTHING, SECOND, SECOND_EFFECTS, SMALL, Case, cases  # noqa: E402
from plant_files import Files, files_of, make_case, second_modules  # noqa: E402
from plant_score import CATALOGUE_NAME, Score, score  # noqa: E402
from plant_table import LINES, effects_text, table_text  # noqa: E402
from run import read_lines, read_scores, run_cases  # noqa: E402
from sensitivity import CRITERION_OF, decided  # noqa: E402

needs_numba = pytest.mark.skipif(not HAS_NUMBA, reason="hundreds of thousands of steps in plain Python")
GAP = {"before": 10.0, "after": 2.0, "floor": 1.0, "interval_after": [1.5, 2.5]}


def truth(effect: str = "", size: float = 0.2, **changes: Any) -> dict[str, Any]:
    kind = KINDS.get(effect)
    return {
        "plant": "lugre", "law": "lugre", "effects": [effect] if effect else [], "size": size, "mass": 10.0,
        "is_inside": kind.is_inside if kind else True, "is_repeatable": kind.is_repeatable if kind else True,
        "figures": {},
    } | changes  # fmt: skip


def entry(name: str, **changes: Any) -> dict[str, Any]:
    told = {"name": name, "parameters": {}, "std_error": {}, "alternatives": [], "gap_before": 10.0, "gap_after": 2.0}
    return told | changes


def scored(
    truth: dict[str, Any], verdict: str, *entries: dict[str, Any], gap: dict[str, Any] = GAP, **more: Any
) -> Score:
    result = {"verdict": verdict, "effects": list(entries), "gap": gap} | more.pop("result", {})
    return score(truth, {"result": result, "seconds": 10.0, "memory": 300.0, "exit_code": 0} | more)


def test_every_effect_inside_has_a_name_and_no_other() -> None:
    for name, kind in KINDS.items():
        assert (name in CATALOGUE_NAME) == kind.is_inside
    assert set(SECOND_EFFECTS) - set(CATALOGUE_NAME) == {"pulses"}


def test_the_right_name_first() -> None:
    one = scored(truth("cogging"), "effect_found", entry("cogging"))
    assert one.is_right_first and one.is_in_set and not one.is_wrong and one.not_shrunk == 0
    assert one.closure == pytest.approx(8.0 / 9.0)
    second = scored(truth("cogging"), "effect_found", entry("spring"), entry("cogging"))
    assert not second.is_right_first and second.is_in_set and second.is_wrong
    other = scored(truth("asymmetry"), "ambiguous", entry("offset", alternatives=["asymmetric_coulomb"]))
    assert not other.is_right_first and other.is_in_set and not other.is_wrong
    viscous = scored(truth("asymmetry"), "effect_found", entry("asymmetric_viscous"))
    assert not viscous.is_right_first and not viscous.is_in_set and viscous.is_wrong
    silent = scored(truth("cogging"), "no_effect", entry("cogging"))
    assert not silent.is_right_first and silent.first == "no_effect"


def test_formulas_that_are_the_same_count_as_the_same() -> None:
    for exponent, is_same in ((2.2, True), (1.2, False)):
        said = entry("nonlinear_viscous", parameters={"exponent": exponent})
        assert scored(truth("quadratic"), "effect_found", said).is_right_first is is_same
    for pitch, is_same in ((6.2, True), (1.0, False)):
        said = entry("cogging", parameters={"pitch": pitch})
        assert scored(truth("gravity"), "effect_found", said).is_right_first is is_same


def test_alarms_where_nothing_is_hidden() -> None:
    assert not scored(truth(), "no_effect").is_alarm
    assert not scored(truth(), "cannot_tell").is_alarm
    assert scored(truth(), "unknown_effect").is_alarm
    assert scored(truth(), "unknown_effect").is_borne_out
    for gap in (GAP | {"after": 10.0}, GAP | {"interval_after": [1.0, 11.0]}, {}):
        assert not scored(truth(), "unknown_effect", gap=gap).is_borne_out
    assert not scored(truth(), "effect_found", entry("cogging")).is_borne_out
    lag = scored(truth(), "effect_found", entry("frictional_lag"))
    assert lag.is_alarm and lag.is_of_contact and lag.is_wrong
    assert not scored(truth(), "effect_found", entry("cogging")).is_of_contact
    assert not scored(truth(law="bouc_wen"), "effect_found", entry("frictional_lag")).is_of_contact


def test_names_that_close_nothing() -> None:
    grown = scored(truth("gain"), "effect_found", entry("actuator_gain", gap_after=10.1))
    assert grown.not_shrunk == 1
    whole = scored(truth("gain"), "effect_found", entry("actuator_gain"), gap=GAP | {"after": 10.0})
    assert whole.not_shrunk == 1
    unsure = scored(truth("gain"), "effect_found", entry("actuator_gain"), gap=GAP | {"interval_after": [1.0, 11.0]})
    assert unsure.is_unsure and unsure.not_shrunk == 0
    assert not scored(truth("gain"), "effect_found", entry("actuator_gain")).is_unsure


def test_what_is_learnt_closes_what_has_no_name() -> None:
    gap = GAP | {"before": 10.0, "after": 10.0, "floor": 1.0, "interval_after": [9.0, 11.0]}
    maps = [{"gap_after": 4.0}, {"gap_after": 4.0}]  # each entry gives the gap with all of them
    told = scored(truth("force_map"), "unknown_effect", gap=gap, result={"learnt": maps})
    assert told.closure == 0.0 and told.closure_by_maps == pytest.approx(6.0 / 9.0)
    assert scored(truth(), "unknown_effect", gap=gap, result={"learnt": maps}).is_borne_out
    assert not scored(truth(), "unknown_effect", gap=gap, result={"learnt": [{"gap_after": 9.9}]}).is_borne_out
    assert not scored(truth(), "unknown_effect", gap=gap).is_borne_out


def test_outside_of_the_catalogue() -> None:
    learnt = {"result": {"remainder": "learnt"}}
    assert scored(truth("force_map"), "unknown_effect").is_told_unknown
    assert not scored(truth("force_map"), "no_effect").is_told_unknown
    assert scored(truth("force_map"), "effect_found", entry("cogging"), **learnt).is_wrong
    part = scored(truth("hysteretic_spring"), "effect_found", entry("spring"), **learnt)
    assert part.is_told_unknown and not part.is_wrong
    assert scored(truth("hysteretic_spring"), "effect_found", entry("spring")).is_wrong


def test_closure_needs_a_gap_to_close() -> None:
    assert scored(truth("cogging"), "no_effect", gap={"before": 1.09, "after": 1.0, "floor": 1.0}).closure is None
    assert scored(truth("cogging"), "no_effect", gap={}).closure is None
    assert scored(truth("cogging"), "no_effect", gap={"before": 3.0, "after": 3.5, "floor": 1.0}).closure == -0.25


def test_intervals() -> None:
    hidden = truth("cogging", figures={"cogging": {"amplitude": 1.0, "pitch": 0.01}})
    errors = {"amplitude": 0.1, "pitch": 1e-5}
    said = entry("cogging", parameters={"amplitude": -1.1, "pitch": 0.0102}, std_error=errors)
    assert scored(hidden, "effect_found", said).covered == (True, False)
    assert scored(hidden, "effect_found", entry("cogging", parameters={"amplitude": 1.0})).covered == ()
    mass = truth("mass", figures={"mass": {"mass": 2.0}})  # on a machine of 10 kg whose owner says 10.4 kg
    said = entry("mass_error", parameters={"mass": 1.6}, std_error={"mass": 0.01})
    assert scored(mass, "effect_found", said, mass=10.4).covered == (True,)
    assert scored(mass, "effect_found", said, mass=10.0).covered == (False,)


def test_a_case_without_a_result_has_failed() -> None:
    one = score(truth("cogging"), {"result": None, "exit_code": 1})
    assert one.has_failed and one.first == "failed" and not one.is_alarm and one.seconds != one.seconds


def test_a_force_above_the_noise_of_the_recording_is_counted_apart() -> None:
    """What is smaller than the noise may be there and hardly show: the hidden force is of the held-out recording."""
    gap = GAP | {"noise": 3.0}
    loud, quiet = (truth("cogging", hidden_rms=[0.5, share]) for share in (0.031, 0.029))
    scores = [scored(loud, "effect_found", entry("cogging"), gap=gap), scored(quiet, "no_effect", gap=gap)]
    assert [one.is_above_noise for one in scores] == [True, False]
    assert not scored(truth("cogging"), "no_effect", gap=gap).is_above_noise
    shares = {name: value(scores) for name, _, value in LINES}
    assert shares["right name first, 10-25 %"] == "50 % (1/2)"
    assert shares["... whose force is above the noise of the held-out recording"] == "100 % (1/1)"
    assert shares["... whose force is above that noise"] == "-"


def test_the_table_has_a_column_per_plant() -> None:
    scores = [
        scored(truth("cogging"), "effect_found", entry("cogging")),
        scored(truth("cogging", size=SMALL), "no_effect"),
        scored(truth("spring", plant="gantry"), "effect_found", entry("cogging")),
        scored(truth(plant="gantry"), "unknown_effect", gap={}),
        scored(truth(plant="gantry"), "unknown_effect"),
    ]
    cells = [[cell.strip() for cell in row.split("|")] for row in table_text(scores).splitlines()]
    rows = {row[1]: row[3:-1] for row in cells}
    assert rows["figure"] == ["lugre", "gantry", "all"]
    assert rows["right name first, 10-25 %"] == ["100 % (1/1)", "0 % (0/1)", "50 % (1/2)"]
    assert rows["right name first, 5 %"] == ["0 % (0/1)", "-", "0 % (0/1)"]
    alarms = next(cells for name, cells in rows.items() if name.startswith("false alarms"))
    assert alarms == ["-", "50 % (1/2)", "50 % (1/2)"]
    assert rows["confidently wrong"] == ["0 % (0/2)", "33 % (1/3)", "20 % (1/5)"]
    assert len(rows) == len(LINES) + 2
    assert "| spring | 10-25 % | 1 | 0 | 0 | cogging (gantry) 1 |" in effects_text(scores)


def outcome(of: str, name: str, value: float, threshold: float, at_least: bool = True) -> dict[str, Any]:
    passed = value >= threshold if at_least else value <= threshold
    return {"of": of, "name": name, "value": value, "threshold": threshold, "passed": passed}


WHOLE = (
    outcome("model", "share of the effort that is unexplained", 0.5, 0.333, at_least=False),
    outcome("model", "surely predictable share of the residual", 0.2, 0.1, at_least=False),
)
NAMED = (
    outcome("offset", "held-out gap: z-score", 2.0, 1.645),
    outcome("offset", "z-score of a better prediction than asymmetric_coulomb", 2.0, 3.0),
    outcome("cogging", "held-out gap: z-score", 1.0, 1.645),
    *WHOLE,
)


@pytest.mark.parametrize("criterion", dict.fromkeys(CRITERION_OF.values()))
@pytest.mark.parametrize(
    ("verdict", "effects", "tests"),
    [
        ("ambiguous", [entry("offset", alternatives=["asymmetric_coulomb"])], NAMED),
        ("cannot_tell", [], WHOLE),
        ("no_effect", [], WHOLE[:0]),
    ],
)
def test_criteria_that_do_not_move_decide_as_the_tool_did(
    verdict: str, effects: list[dict[str, Any]], tests: tuple[dict[str, Any], ...], criterion: str
) -> None:
    result = {"verdict": verdict, "effects": effects, "learnt": [], "tests": list(tests)}
    assert decided(result, criterion, 1.0) == result


def test_a_criterion_that_moves_gives_and_takes_names_and_alternatives() -> None:
    effects = [entry("offset", alternatives=["asymmetric_coulomb"])]
    result = {"verdict": "ambiguous", "effects": effects, "learnt": [], "tests": list(NAMED)}
    sure = decided(result, "min_z_score", 0.5)
    assert sure["verdict"] == "effect_found" and sure["effects"][0]["alternatives"] == []
    assert [one["name"] for one in decided(result, "interval_z_score", 0.5)["effects"]] == ["offset", "cogging"]
    without = decided(result, "interval_z_score", 2.0)
    assert without["effects"] == [] and without["verdict"] == "cannot_tell", "half of the effort is unexplained"
    assert decided(result, "max_unexplained", 2.0)["verdict"] == "ambiguous"
    explained = {"verdict": "cannot_tell", "effects": [], "learnt": [], "tests": list(WHOLE)}
    assert decided(explained, "max_unexplained", 2.0)["verdict"] == "unknown_effect"


@pytest.mark.parametrize("plant", [*PLANTS, SECOND])
def test_cases_are_fair_and_repeatable(plant: str) -> None:
    amount = AMOUNTS["half"]
    listed = cases(plant, "half", 5000)
    assert listed == cases(plant, "half", 5000)
    assert len(set(listed)) == len(listed)
    assert sum(case.effect == NOTHING for case in listed) == amount.nothing
    assert all(case.seed >= 5000 for case in listed)
    if plant != SECOND:
        assert all(case.effect == NOTHING or case.size == SMALL or 0.1 <= case.size <= 0.25 for case in listed)
        assert any(case.effect == "gravity" for case in listed) == (plant == "robot_joint")


def pretend(files: Files) -> dict[str, Any]:
    """Stand for the workflow: note what it can see, and say that it found nothing."""
    seen = sorted(str(path.relative_to(files.folder)) for path in files.folder.rglob("*"))
    files.result.mkdir()
    result = {"verdict": "no_effect", "effects": [], "gap": {}, "seen": seen}
    (files.result / "result.json").write_text(json.dumps(result), encoding="utf-8")
    return {"exit_code": 0, "seconds": 1.0, "memory": 1.0, "message": ""}


@needs_numba
def test_runs_goes_on_and_keeps_the_truth_sealed(tmp_path: Path) -> None:
    listed = [Case("slow_log", 3, NOTHING, 0.0), Case("slow_log", 3, "cogging", 0.2)]
    run_cases(listed[:1], tmp_path, duration=3.0, diagnose=pretend)
    run_cases(listed, tmp_path, duration=3.0, diagnose=pretend)
    lines = read_lines(tmp_path)
    assert [Case(**line["case"]) for line in lines] == listed
    for line, case in zip(lines, listed, strict=True):
        assert [name for name in line["result"]["seen"] if "cogging" in name or "truth" in name] == []
        files = files_of(case, tmp_path)
        assert files.truth.is_file() and files.folder not in files.truth.parents
        assert not files.bag.exists()  # not kept
        assert "cogging" not in files.config.read_text(encoding="utf-8")
    scores = read_scores(listed, tmp_path)
    assert [one.effect for one in scores] == ["", "cogging"]
    assert not any(one.is_alarm for one in scores)
    files = files_of(listed[1], tmp_path)
    files.truth.write_text(files.truth.read_text(encoding="utf-8").replace("cogging", "offset"), encoding="utf-8")
    with pytest.raises(ValueError, match="was changed after"):
        read_scores(listed, tmp_path)
    with (tmp_path / "results.jsonl").open("a", encoding="utf-8") as results:
        results.write('{"case": {"pl')  # a run that was killed
    assert len(read_lines(tmp_path)) == 2


def shared_folder() -> Path:
    """Return the folder beside the checkout that holds the second plant, or skip."""
    given = os.environ.get("SGMS_SHARED")
    for folder in [Path(given)] if given else [parent / "shared" for parent in ROOT.parents]:
        if (folder / "plants" / "second_plant.py").is_file():
            return folder
    pytest.skip("no shared/plants/second_plant.py beside the checkout; name its parent folder in SGMS_SHARED")


@needs_numba
def test_the_second_plant_is_read_as_it_is(tmp_path: Path) -> None:
    pytest.importorskip("rosbags", reason="the second plant writes its bags with rosbags, which is not installed")
    shared = shared_folder()
    case = Case(SECOND, 2, "cogging", 0.17)
    files = make_case(case, tmp_path, 2.0, shared)
    assert load_settings(files.config).axes[0].mass == pytest.approx(12.0, rel=0.05)
    assert files.bag.is_dir() and files.holdout.is_dir()
    figures = json.loads(files.truth.read_text(encoding="utf-8"))["figures"]["cogging"]
    assert figures["amplitude"] == pytest.approx(1.4)


def test_without_the_second_plant_it_says_where_it_looked(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"has no second_plant\.py; give its parent folder with --shared"):
        second_modules(tmp_path)
