"""What the shipped configuration is worth, by the command that docs/compensation.md names."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from sgms_observer.cli.main import main

CONFIG = Path(__file__).parents[2] / "config" / "compensation.yaml"


def test_five_times_less_rms_and_four_times_less_peak(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The paper's sine, and a 20 mm move with dwells; same controller and noise with and without."""
    arguments = ["--config", str(CONFIG), "--observe", "--duration", "1.6", "--out", str(tmp_path / "bag")]
    assert main(["simulate", *arguments]) == 0
    said = capsys.readouterr().out
    found = dict(re.findall(r"^(\w+): tracking .*: ([\d.]+ and [\d.]+) times as large", said, re.MULTILINE))
    assert set(found) == {"sine", "move"}
    for axis, text in found.items():
        rms, peak = map(float, text.split(" and "))
        assert rms >= 5.0 and peak >= 4.0, axis
