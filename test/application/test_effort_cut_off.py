"""Recordings with an effort that is cut off, and recordings that are short for a diagnosis."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sgms_observer.application.bag_info import inspect_bag
from sgms_observer.bags.conversion import Table, write_table
from sgms_observer.cli.main import main

PERIOD = 5.0e-3
SENTENCE = "the effort of bag is cut off at -60 and 60 N or N m, which "


def _bag(folder: Path, seconds: float, largest: float = np.inf, pause: float = 0.0) -> str:
    """Return a bag of an axis whose log shows no effort beyond ``largest`` [N]; it pauses every 2 s for ``pause`` s."""
    time = PERIOD * np.arange(round(seconds / PERIOD))
    position = 0.1 * np.sin(3.0 * time) + 0.02 * np.sin(11.0 * time)
    velocity = np.gradient(position, PERIOD)
    effort = 14.0 * np.gradient(velocity, PERIOD) + 20.0 * velocity + 13.0 * np.tanh(velocity / 1e-3)
    effort += np.random.default_rng(1).normal(0.0, 0.5, len(time))
    stamps = np.rint((1.0 + time + pause * np.floor(time / 2.0)) * 1e9).astype(np.int64)
    write_table(Table(stamps, position, np.clip(effort, -largest, largest), None, None, ()), folder / "bag", "x")
    return str(folder / "bag")


def test_info_init_check_and_identify_report_an_effort_that_is_cut_off(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bag, config = _bag(tmp_path, 30.0, 60.0), str(tmp_path / "start.yaml")
    for command in (
        ["info", bag],
        ["init", bag, "--out", config],
        ["check", config, bag],
        ["identify", bag, "--config", config, "--out", str(tmp_path / "out.yaml"), "--elements", "1"],
    ):
        main(command)
        assert SENTENCE in capsys.readouterr().err, command


def test_a_whole_effort_is_not_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", _bag(tmp_path, 30.0)]) == 0
    assert "cut off" not in capsys.readouterr().err


@pytest.mark.parametrize(
    ("seconds", "pause", "use", "note"),
    [
        (12.0, 0.5, "the longest piece without a pause lasts 2 s, and 3 s are needed", ""),
        (12.0, 0.0, "", "note: a diagnosis can use 12 of 12 s; 30 s are better"),
        (40.0, 0.0, "", ""),
    ],
)
def test_info_tells_the_seconds_that_a_diagnosis_can_use(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], seconds: float, pause: float, use: str, note: str
) -> None:
    bag = _bag(tmp_path, seconds, pause=pause)
    (axis,) = inspect_bag(bag, {}).axes
    reason = next(one.reason for one in axis.uses if one.purpose == "diagnose")
    assert reason.startswith(use) and bool(use) == bool(reason)
    assert main(["info", bag]) == 0
    printed = capsys.readouterr().out
    assert note in printed and ("a diagnosis can use" in printed) == bool(note)
