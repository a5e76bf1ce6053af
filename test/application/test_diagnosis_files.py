"""A diagnosis writes its files together at the end: one that is stopped leaves none."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from sgms_observer.application.diagnose import _CompensationStep
from sgms_observer.diagnosis import result
from sgms_observer.diagnosis.diagnosis import Options
from sgms_observer.settings.load import load_settings, settings_from_tree


def test_the_augmented_file_is_tested_before_it_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The feedforward of an answer is tested with the axis that the file will have, relative file names included."""
    given, out = tmp_path / "given", tmp_path / "out"
    given.mkdir()
    (given / "motion.csv").write_text("0,0\n")
    tree = {"axes": ["x"], "x": {"mass": 3.0, "stage": {"reference": {"kind": "file", "file": "motion.csv"}}}}
    settings = settings_from_tree(tree, folder=given)
    monkeypatch.setattr(result, "changes_of", lambda _: {"mass": 2.5})
    answer: Any = SimpleNamespace(effects=(), verdict="no_effect", gap=SimpleNamespace(before=5.0, after=2.0))
    record: Any = None
    axis = _CompensationStep(record, settings, settings.axes[0], Options()).written(answer)
    assert axis.mass == 2.5 and Path(axis.stage.reference.file).samefile(given / "motion.csv")
    assert [path.name for path in tmp_path.rglob("*")] == ["given", "motion.csv"]
    result.write_augmented(answer, settings, "x", out)
    written = load_settings(out / "augmented.yaml").axes[0]
    assert written.mass == axis.mass and Path(written.stage.reference.file).samefile(axis.stage.reference.file)
