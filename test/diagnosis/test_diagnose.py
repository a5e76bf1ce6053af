"""``sgms diagnose`` from bags to files: a blind case, its truth opened only at the end."""

import json
from pathlib import Path

import pytest
from browser import Browser
from looks import check_report
from workflow_case import AXIS, record

from sgms_observer.cli.main import main
from sgms_observer.diagnosis.answer import answer_of
from sgms_observer.diagnosis.workflow import Options, diagnose
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.load import load_settings
from sim_plant.blind.case import CasePaths, make_case

SCHEMA = {
    "schema", "verdict", "usable", "warnings", "gap", "effects", "learnt", "changed", "remainder", "tests", "located",
    "feedforward", "detectable", "next_experiment",
}  # fmt: skip
GAP = {
    "given", "before", "after", "named", "predictable", "floor", "noise", "unit", "on", "band_hz", "closure",
    "interval_before", "interval_after",
}  # fmt: skip


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> tuple[CasePaths, Path]:
    folder = tmp_path_factory.mktemp("blind")
    paths = make_case(11, "cogging", 0.1, folder)
    out = folder / "out"
    arguments = ["diagnose", str(paths.bag), "--config", str(paths.config), "--out", str(out), "--holdout"]
    assert main([*arguments, *(str(path) for path in paths.holdouts)]) == 0
    return paths, out


def test_result_names_the_hidden_effect_and_closes_the_gap(case: tuple[CasePaths, Path]) -> None:
    paths, out = case
    result = json.loads((out / "result.json").read_text())
    truth = json.loads(paths.truth_file.read_text())
    assert set(result) >= SCHEMA and result["schema"] == 2
    assert set(result["gap"]) == GAP
    assert result["verdict"] == "effect_found"
    assert [item["name"] for item in result["effects"]] == truth["effects"]
    found, hidden = result["effects"][0]["parameters"], truth["parameters"]["cogging"]
    assert found["pitch"] == pytest.approx(hidden["pitch"], rel=0.02)
    assert abs(found["amplitude"]) == pytest.approx(hidden["amplitude"], rel=0.05)
    assert result["gap"]["on"] == "held-out"
    assert result["gap"]["after"] < 0.5 * result["gap"]["before"]
    assert result["located"][0]["coordinate"] == "position"


def test_augmented_settings_load_and_hold_the_effect(case: tuple[CasePaths, Path]) -> None:
    axis = load_settings(case[1] / "augmented.yaml").axes[0]
    assert [item.name for item in axis.effects] == ["cogging"]


def test_report_is_self_contained(case: tuple[CasePaths, Path]) -> None:
    page = (case[1] / "report.html").read_text()
    assert "cogging" in page and "What these recordings could not show" in page
    assert 'src="http' not in page and 'href="http' not in page


def test_report_reads_well_in_a_browser(case: tuple[CasePaths, Path], browser: Browser) -> None:
    check_report(browser, case[1] / "report.html", 3)


def verdict_of(learn: Recording) -> str:
    """Return the verdict on one recording."""
    options = Options(workers=2)
    return answer_of(diagnose([learn], [], AXIS, options), AXIS, options).verdict


def test_nothing_hidden_is_no_effect() -> None:
    assert verdict_of(record(duration=15.0)) == "no_effect"


def test_a_stage_that_hardly_moves_cannot_tell() -> None:
    full = record(duration=8.0)
    still = type(full)("still", full.period, full.position[:8000] * 1e-6, full.effort[:8000] * 0.0 + 0.01)
    assert verdict_of(still) == "cannot_tell"


def test_an_unknown_axis_is_one_sentence(case: tuple[CasePaths, Path], capsys: pytest.CaptureFixture[str]) -> None:
    paths, out = case
    arguments = ["diagnose", str(paths.bag), "--config", str(paths.config), "--out", str(out), "--axis", "q"]
    code = main([*arguments, "--overwrite"])
    assert code != 0
    assert capsys.readouterr().err.count("--axis q is not in") == 1
