"""Cases: sealed truth, names that tell nothing, a twin that differs in the effect alone."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import yaml

from sgms_observer.jit import HAS_NUMBA
from sim_plant.blind import make_case
from sim_plant.blind.case import SEAL_FILE, digest, make_scene, open_seal, seal
from sim_plant.blind.menu import INSIDE, OUTSIDE

needs_numba = pytest.mark.skipif(not HAS_NUMBA, reason="millions of steps in plain Python")


@needs_numba
def test_case_shows_nothing_of_its_truth(tmp_path: Path) -> None:
    paths = make_case(1, "cogging", 0.15, tmp_path, duration=4.0)
    truth = open_seal(paths.truth_file, paths.folder)
    assert truth["effects"] == ["cogging"]
    assert paths.folder not in paths.truth_file.parents
    for path in paths.folder.rglob("*"):
        assert not any(name in str(path) for name in (*INSIDE, *OUTSIDE))
        if path.is_file():
            content = path.read_bytes()
            content = content.replace(b"stribeck_velocity", b"")  # a nominal parameter of every YAML
            assert not any(name.encode() in content for name in (*INSIDE, *OUTSIDE)), path
            assert truth["salt"].encode() not in content
    tree = yaml.safe_load(paths.config.read_text())["/**"]["ros__parameters"]
    assert tree["axes"][0] == "x"
    assert len(tree["x"]["friction"]["element_stiffness"]) == 4
    assert "effects" not in tree["x"]


@needs_numba
def test_bags_hold_all_topics(tmp_path: Path) -> None:
    from sgms_observer.bags.bag_folder import METADATA
    from sgms_observer.bags.reader import BagSamples

    paths = make_case(2, "nothing", 0.0, tmp_path, duration=2.0)
    for bag in (paths.bag, *paths.holdouts):
        content = (bag / METADATA).read_text()
        for topic in ("/position", "/control_effort", "/reference"):
            assert topic in content
        samples = BagSamples(bag, ["x"])
        blocks = [block for _, block in samples]
        assert samples.warnings == () and np.isfinite(blocks[0].reference_position[0])


@needs_numba
def test_twin_differs_in_the_effect_alone() -> None:
    case, twin = make_scene(9, "offset", 0.2, 3.0), make_scene(9, "nothing", 0.0, 3.0)
    assert case.nominal == twin.nominal
    assert [motion.kind for motion in case.motions] == [motion.kind for motion in twin.motions]
    here, there = case.tracks[0]["x"], twin.tracks[0]["x"]
    assert np.array_equal(here.reference, there.reference)
    force = case.truths["offset"]["force"]
    assert np.mean(here.effort - there.effort) == pytest.approx(force, rel=0.2)
    again = make_scene(9, "offset", 0.2, 3.0).tracks[0]["x"]
    assert np.array_equal(here.effort, again.effort)


@needs_numba
def test_too_small_to_be_a_discrepancy() -> None:
    with pytest.raises(ValueError, match="tolerance"):
        make_scene(1, "mass_error", 0.05, 2.0)


def test_seal_breaks(tmp_path: Path) -> None:
    case, truth_file = tmp_path / "case", tmp_path / "truth" / "case.json"
    case.mkdir()
    with pytest.raises(ValueError, match="salt"):
        seal({"effects": []}, truth_file, case)
    with pytest.raises(ValueError, match="inside the case"):
        seal({"effects": [], "salt": "1"}, case / "truth.json", case)
    seal({"effects": ["offset"], "salt": "1"}, truth_file, case)
    assert open_seal(truth_file, case)["effects"] == ["offset"]
    assert (case / SEAL_FILE).read_text().strip() == digest({"salt": "1", "effects": ["offset"]})
    truth_file.write_text(json.dumps({"effects": ["cogging"], "salt": "1"}))
    with pytest.raises(ValueError, match="changed after"):
        open_seal(truth_file, case)
