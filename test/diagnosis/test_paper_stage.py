"""The paper's stage has a contact with frictional lag (GMS, 50 N/s), its estimator a model without: S-GMS."""

import json
from pathlib import Path

import pytest
import yaml

from sgms_observer.cli.main import main

CONFIG = Path(__file__).resolve().parents[2] / "config" / "paper.yaml"
TO_LEARN = {"kind": "multi_sine", "amplitudes": [1.5e-4, 4.0e-5, 1.0e-5], "frequencies": [0.7, 3.1, 9.7]}
TO_JUDGE = {"kind": "sine", "amplitude": 2.0e-4, "frequency": 5.0}


def simulated(
    folder: Path, name: str, reference: dict[str, object], duration: float, seed: int = 1
) -> tuple[Path, float]:
    tree = yaml.safe_load(CONFIG.read_text(encoding="utf-8"))
    axis = tree["/**"]["ros__parameters"]["x"]
    axis["stage"] |= {"reference": reference, "seed": seed}
    config = folder / f"{name}.yaml"
    config.write_text(yaml.safe_dump(tree), encoding="utf-8")
    assert main(["simulate", "--config", str(config), "--out", str(folder / name), "--duration", str(duration)]) == 0
    return folder / name, axis["friction"]["attraction_rate"]


def test_the_lag_is_found_added_and_closes_the_gap(tmp_path: Path) -> None:
    """The sine hardly determines the strength of the lag, and must not take the name for that."""
    learn, rate = simulated(tmp_path, "several_sines", TO_LEARN, 5.0, 20)
    judge, _ = simulated(tmp_path, "paper_sine", TO_JUDGE, 3.0, 21)
    arguments = ["diagnose", str(learn), "--config", str(CONFIG), "--holdout", str(judge)]
    assert main([*arguments, "--out", str(tmp_path / "out")]) == 0
    result = json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))
    assert result["verdict"] == "effect_found"
    assert [item["name"] for item in result["effects"]] == ["frictional_lag"]
    assert result["effects"][0]["parameters"]["attraction_rate"] == pytest.approx(rate, rel=0.3)
    assert result["gap"]["on"] == "held-out"
    assert result["gap"]["after"] < 0.25 * result["gap"]["before"]


def test_a_far_gap_on_an_unseen_motion_is_never_no_effect(tmp_path: Path) -> None:
    """One sine is fitted by bending the elements; another amplitude shows that nothing was understood."""
    learn, _ = simulated(tmp_path, "paper_sine", TO_JUDGE, 3.2)
    judge, _ = simulated(tmp_path, "smaller_sine", {"kind": "sine", "amplitude": 6.0e-5, "frequency": 2.0}, 3.2)
    arguments = ["diagnose", str(learn), "--config", str(CONFIG), "--holdout", str(judge)]
    assert main([*arguments, "--out", str(tmp_path / "out")]) == 0
    result = json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))
    assert result["gap"]["before"] > 5.0 * result["gap"]["noise"]
    assert result["verdict"] != "no_effect"
