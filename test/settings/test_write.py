"""Parameter files written back: whole or not at all, with what was not ours untouched."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from sgms_observer.errors import RecordingError
from sgms_observer.settings.load import load_settings, settings_from_tree
from sgms_observer.settings.parameter_file import read_document
from sgms_observer.settings.write import tree_of, updated_tree, write_settings, yaml_of
from sgms_observer.whole_file import write_text

TEXT = """
/**:
  ros__parameters:
    axes: [x, y]
    x: {mass: 3, friction.static_force: 5, effects: {names: [cogging], cogging: {amplitude: 1e-1}}}
/observer_node:
  ros__parameters:
    x: {mass: 4.0}
/controller_manager:
  ros__parameters: {update_rate: 1000, name: "y", gain: 1e-4, code: 010, list: [1, 2.5]}
"""


@pytest.fixture
def document(tmp_path: Path) -> dict[Any, Any]:
    """Return the tree of a file with a stranger's section."""
    path = tmp_path / "before.yaml"
    path.write_text(TEXT, encoding="utf-8")
    return read_document(path)


def test_a_change_stands_where_it_counts(document: dict[Any, Any], tmp_path: Path) -> None:
    changes = {
        "mass": np.float64(5),
        "friction.static_force": 6,
        "friction.element_damping": (0, 1, 2, np.float32(3)),
        "effects.names": ("cogging", "offset"),
        "effects.offset": {"force": 0.5},
        "effects.cogging.amplitude": None,
    }
    before = repr(document)
    changed = updated_tree(document, "x", changes)
    assert repr(document) == before
    path = tmp_path / "after.yaml"
    write_text(yaml_of(changed), path)
    axis = load_settings(path).axes[0]
    assert axis.mass == 5.0
    assert axis.friction.static_force == 6.0
    assert axis.friction.element_damping == (0.0, 1.0, 2.0, 3.0)
    assert [effect.name for effect in axis.effects] == ["cogging", "offset"]
    assert axis.effects[0].values[0] == 0.0 and axis.effects[1].values == (0.5,)
    observer = load_settings(path, node_names=("observer_node",)).axes[0]
    stage = load_settings(path, node_names=("stage_node",)).axes[0]
    assert (observer.mass, stage.mass) == (5.0, 3.0)


def test_shared_settings_change_too(document: dict[Any, Any], tmp_path: Path) -> None:
    write_text(yaml_of(updated_tree(document, "", {"sample_period": 1e-3})), tmp_path / "after.yaml")
    assert load_settings(tmp_path / "after.yaml").sample_period == 1e-3


def test_a_strangers_section_stays_as_it_is(document: dict[Any, Any]) -> None:
    text = yaml_of(document)
    for part in ("update_rate: 1000", 'name: "y"', "gain: 1e-4", "code: 010", "list: [1, 2.5]"):
        assert f"    {part}\n" in text


def test_numbers_are_floats_and_words_are_words_for_both_parsers(document: dict[Any, Any]) -> None:
    own = yaml.safe_load(yaml_of(document))["/**"]["ros__parameters"]
    assert own["axes"] == ["x", "y"] and '"y"' in yaml_of(document)
    assert isinstance(own["x"]["mass"], float) and own["x"]["friction"]["static_force"] == 5.0
    assert own["x"]["effects"]["cogging"]["amplitude"] == 0.1


def test_aliases_are_written_out(tmp_path: Path) -> None:
    path = tmp_path / "before.yaml"
    path.write_text(
        "/**: {ros__parameters: {axes: [x, y], x: &x {friction: {static_force: 5.0}}, y: {<<: *x, mass: 3.0}}}",
        encoding="utf-8",
    )
    changed = updated_tree(read_document(path), "x", {"friction.static_force": 6.0})
    text = yaml_of(changed)
    assert "&" not in text and "*x" not in text and "<<" not in text
    write_text(yaml_of(changed), path)
    x, y = load_settings(path).axes
    assert (x.friction.static_force, y.friction.static_force, y.mass) == (6.0, 5.0, 3.0)


def test_remarks_stand_behind_their_parameter(document: dict[Any, Any], tmp_path: Path) -> None:
    remarks = {
        "": "found by identify\nin two lines",
        "x.mass": "+- 0.1 kg",
        "x.effects.cogging": "new",
        "nothing": "nowhere",
    }
    text = yaml_of(document, remarks)
    lines = text.splitlines()
    assert lines[:2] == ["# found by identify", "# in two lines"]
    assert "      mass: 3.0  # +- 0.1 kg" in lines
    assert "        # new" in lines and "nowhere" not in text
    assert yaml.safe_load(text) == yaml.safe_load(yaml_of(document))


def test_settings_write_themselves_with_their_files(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "lap.csv").write_text("0,0\n", encoding="utf-8")
    (tmp_path / "a" / "in.yaml").write_text(
        "/**: {ros__parameters: {x: {stage: {reference: {kind: file, file: lap.csv}}}}}", encoding="utf-8"
    )
    out = tmp_path / "b" / "c" / "out.yaml"
    write_settings(load_settings(tmp_path / "a" / "in.yaml"), out, {"x": {"mass": 4.0}}, {"x.mass": "new"})
    assert f"file: {os.path.join('..', '..', 'a', 'lap.csv')}\n" in out.read_text(encoding="utf-8").replace('"', "")
    settings = load_settings(out)
    assert settings.axes[0].mass == 4.0
    assert Path(settings.axes[0].stage.reference.file).is_file()


def test_everything_written_out_is_read_the_same(tmp_path: Path) -> None:
    settings = settings_from_tree({"axes": ["x", "y"]})
    write_text(yaml_of(tree_of(settings)), tmp_path / "all.yaml")
    assert load_settings(tmp_path / "all.yaml") == settings


def test_a_file_is_replaced_whole(tmp_path: Path, document: dict[Any, Any]) -> None:
    path = tmp_path / "out.yaml"
    path.write_text("before", encoding="utf-8")
    link = tmp_path / "link.yaml"
    link.symlink_to(path)
    write_text(yaml_of(document), link)
    assert link.is_symlink() and path.read_text(encoding="utf-8").startswith("/**:")
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["before.yaml", "link.yaml", "out.yaml"]


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EROFS, errno.EIO])
@pytest.mark.parametrize("call", ["fsync", "replace"])
def test_a_disk_that_fails_leaves_the_old_file(
    number: int, call: str, tmp_path: Path, document: dict[Any, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: Any) -> None:
        raise OSError(number, os.strerror(number))

    path = tmp_path / "out.yaml"
    path.write_text("before", encoding="utf-8")
    monkeypatch.setattr(os, call, fail)
    with pytest.raises(RecordingError) as error:
        write_text(yaml_of(document), path)
    monkeypatch.undo()
    assert str(error.value) == f"{path} cannot be written: {os.strerror(number)}; make room or choose another folder"
    assert path.read_text(encoding="utf-8") == "before"
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["before.yaml", "out.yaml"]


def test_a_folder_that_is_a_file(tmp_path: Path, document: dict[Any, Any]) -> None:
    with pytest.raises(RecordingError) as error:
        write_text(yaml_of(document), tmp_path / "before.yaml" / "out.yaml")
    assert "cannot be written" in str(error.value)
    with pytest.raises(RecordingError):
        write_text(yaml_of(document), tmp_path)


def test_the_truth_of_a_simulation_stays_where_the_observer_gets_other_elements(tmp_path: Path) -> None:
    given = load_settings(Path(__file__).parents[2] / "config" / "demo.yaml")
    elements = {"element_stiffness": [3.0e6, 2.0e6, 1.0e6], "element_fraction": [0.5, 0.3, 0.2]}
    changes = {f"friction.{key}": value for key, value in elements.items()}
    write_settings(given, tmp_path / "other.yaml", {"x": changes | {"friction.element_damping": [0.0, 0.0, 0.0]}})
    (axis,) = load_settings(tmp_path / "other.yaml").axes
    assert axis.friction.element_stiffness == (3.0e6, 2.0e6, 1.0e6)
    assert axis.stage_friction == given.axes[0].stage_friction is not None
