"""``sgms diagnose`` from bags to files: a blind case, its truth opened only at the end."""

import html
import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from browser import Browser
from looks import check_report
from workflow_case import AXIS, record

from sgms_observer.application import diagnose as application
from sgms_observer.bags.reader import read_joint_states
from sgms_observer.cli.main import main
from sgms_observer.diagnosis.answer import answer_of
from sgms_observer.diagnosis.diagnosis import Options
from sgms_observer.diagnosis.workflow import diagnose
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.load import load_settings
from sim_plant.blind.case import CasePaths, make_case

SCHEMA = {
    "schema", "verdict", "usable", "warnings", "gap", "effects", "learnt", "changed", "remainder", "tests", "located",
    "feedforward", "detectable", "next_experiment",
}  # fmt: skip
GAP = {
    "given", "before", "after", "named", "predictable", "floor", "noise", "unit", "on", "band_hz", "closure",
    "interval_before", "interval_after", "unweighted",
}  # fmt: skip


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> tuple[CasePaths, Path]:
    folder = tmp_path_factory.mktemp("blind")
    paths = make_case(11, "cogging", 0.1, folder)
    out = folder / "out"
    arguments = ["diagnose", str(paths.bag), "--config", str(paths.config), "--out", str(out), "--holdout"]
    with pytest.MonkeyPatch.context() as patch:  # as of a controller that is not linear
        patch.setattr(application, "recorded_controller", lambda *_: None)
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


def test_a_doubt_about_the_predicted_tracking_is_among_the_warnings(case: tuple[CasePaths, Path]) -> None:
    result = json.loads((case[1] / "result.json").read_text())
    caution = result["tracking_predicted"]["caution"]
    page = html.unescape((case[1] / "report.html").read_text())
    above = page[: page.index("<h2>")]
    assert "stage.controller" in caution, "the case's own loop is not the controller of its file"
    assert caution in result["warnings"] and f"<p>Warning: {caution}.</p>" in above


def test_report_asks_for_the_pitch_that_was_found(case: tuple[CasePaths, Path]) -> None:
    page = (case[1] / "report.html").read_text()
    item = json.loads((case[1] / "result.json").read_text())["effects"][0]
    pitch = f"{1e3 * item['parameters']['pitch']:#.3g}".rstrip(".")
    question = rf'<span class="question">Is there a {pitch} mm pitch\?</span>'
    lamp = r'<li class="(\w+)"><span class="lamp"[^>]*>.</span>'
    found = re.search(rf"{lamp}{question} <strong>([^<]+)</strong> ([^<]+)</li>", page)
    assert found is not None
    assert found[1] == ("unsure" if item["alternatives"] else "good")
    assert f"Confidence {item['confidence']:.2f}." in found[3]
    assert f"from {item['gap_before']:.3g} to {item['gap_after']:.3g} %" in found[3]


def test_report_shows_what_it_is_made_for(case: tuple[CasePaths, Path]) -> None:
    page = (case[1] / "report.html").read_text()
    for label in (
        "gap [% of rms effort]", "file as given", "with cogging", "residual [N]", "position [mm]", "effect, forward",
        "measured force [N]", "modelled force [N]", "friction [N]", "velocity [mm/s]", "tracking error [um]",
    ):  # fmt: skip
        assert f">{label}<" in page, label
    folded = page[page.index("<details") :]
    assert "Round 1: hypotheses fitted fully" in folded and "Screening" in folded
    gap = json.loads((case[1] / "result.json").read_text())["gap"]
    assert f"rows, fit {100.0 - gap['after']:.1f} %" in page


def test_report_reads_well_in_a_browser(case: tuple[CasePaths, Path], browser: Browser) -> None:
    check_report(browser, case[1] / "report.html", 8)


def test_residual_log_holds_what_the_gap_is_made_of(case: tuple[CasePaths, Path]) -> None:
    """Measured = modelled + residual at the stamps of the recording; their weighted rms are the gap of result.json."""
    paths, out = case
    log = out / "residual.mcap"
    gap = json.loads((out / "result.json").read_text())["gap"]
    squares = dict.fromkeys(("measured", "residual_before", "residual"), 0.0)
    count = 0
    for bag in paths.holdouts:
        effort = {}
        for topic in (*squares, "modelled_before", "modelled", "effects"):
            states = read_joint_states(log, f"{bag.name}/{topic}")
            assert list(states.names) == (["cogging"] if topic == "effects" else ["x"])
            effort[topic] = states.effort[:, 0]
        assert effort["modelled"] + effort["residual"] == pytest.approx(effort["measured"])
        assert effort["modelled_before"] + effort["residual_before"] == pytest.approx(effort["measured"])
        measured = read_joint_states(log, f"{bag.name}/measured")
        recorded = read_joint_states(bag, "position")
        near = np.searchsorted(recorded.stamp_ns, measured.stamp_ns)
        assert np.abs(recorded.stamp_ns[near] - measured.stamp_ns).max() < 1_000
        assert np.abs(recorded.position[near, 0] - measured.position[:, 0]).max() < 1e-5
        weight = read_joint_states(log, f"{bag.name}/weight").effort[:, 0]
        assert weight.max() <= 1.0 and np.median(weight) > 0.99 and weight[0] < 0.1  # it starts in an unknown state
        for topic in squares:
            squares[topic] += float(np.sum(np.square(weight * effort[topic])))
        count += effort["measured"].size
    assert count > 1_000
    share = {topic: 100.0 * math.sqrt(square / squares["measured"]) for topic, square in squares.items()}
    assert share["residual"] == pytest.approx(gap["after"])
    assert share["residual_before"] == pytest.approx(gap["before"])


def test_effort_of_the_effect_in_the_log_is_that_of_its_parameters(case: tuple[CasePaths, Path]) -> None:
    paths, out = case
    found = json.loads((out / "result.json").read_text())["effects"][0]["parameters"]
    above = paths.holdouts[0].name
    position = read_joint_states(out / "residual.mcap", f"{above}/measured").position[:, 0]
    effort = read_joint_states(out / "residual.mcap", f"{above}/effects").effort[:, 0]
    angle = 2.0 * np.pi * position / found["pitch"]
    force = found["amplitude"] * np.sin(angle + found["phase"])
    force += found["second_amplitude"] * np.sin(2.0 * angle + found["second_phase"])
    assert np.sqrt(np.mean((effort - force) ** 2)) < 0.02 * abs(found["amplitude"])


def verdict_of(learn: Recording) -> str:
    """Return the verdict on one recording."""
    options = Options(workers=2)
    return answer_of(diagnose([learn], [], AXIS, options), AXIS, options).verdict


def test_nothing_hidden_is_no_effect() -> None:
    assert verdict_of(record(duration=8.0)) == "no_effect"


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
