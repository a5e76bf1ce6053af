"""The scorer on results made by hand: every figure, both ways."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from sim_plant.blind.score import CaseScore, closure, compare, score_case
from sim_plant.blind.table import (
    Share,
    confusion_picture,
    confusion_text,
    count,
    figures,
    lower_tenth,
    matrix,
    per_effect_text,
    table_text,
)


def truth(*effects: str, size: float = 0.2, is_inside: bool = True, **parameters: dict[str, float]) -> dict[str, Any]:
    return {"effects": list(effects), "size": size, "is_inside": is_inside, "parameters": parameters}


def result(verdict: str, *names: str, alternatives: tuple[str, ...] = (), **gap: float) -> dict[str, Any]:
    entries = [{"name": name, "parameters": {}, "std_error": {}, "alternatives": list(alternatives)} for name in names]
    return {"verdict": verdict, "effects": entries, "gap": gap}


def value(scores: list[CaseScore], name: str) -> str:
    return next(one.value for one in figures(scores) if one.name == name)


def reached(scores: list[CaseScore], name: str) -> bool | None:
    return next(one.is_reached for one in figures(scores) if one.name == name)


def test_wilson() -> None:
    low, high = Share(95, 100).bounds
    assert (low, high) == pytest.approx((0.8882, 0.9785), abs=1e-4)  # Wilson (1927), as tabulated
    assert Share(0, 100).bounds[1] == pytest.approx(0.0370, abs=1e-4)
    assert str(Share(0, 0)) == "no case"
    assert count([True, False, True]).value == pytest.approx(2 / 3)


def test_false_alarm() -> None:
    quiet = score_case(truth(), result("no_effect"))
    loud = score_case(truth(), result("effect_found", "cogging"))
    unsure = score_case(truth(), result("unknown_effect"))
    silent = score_case(truth(), result("cannot_tell"))
    assert [one.is_alarm for one in (quiet, loud, unsure, silent)] == [False, True, True, False]
    assert [one.is_confidently_wrong for one in (quiet, loud, unsure)] == [False, True, False]
    assert value([quiet, loud, unsure, silent], "false alarms, nothing hidden").startswith("50.0 % (2/4")
    assert reached([quiet], "false alarms, nothing hidden") is True


def test_right_name_and_set() -> None:
    right = score_case(truth("cogging"), result("effect_found", "cogging"))
    second = score_case(truth("cogging"), result("ambiguous", "spring", alternatives=("cogging",)))
    wrong = score_case(truth("cogging"), result("effect_found", "spring"))
    missed = score_case(truth("cogging"), result("no_effect"))
    assert [one.first for one in (right, second, wrong, missed)] == ["cogging", "spring", "spring", "no_effect"]
    assert [one.is_confidently_wrong for one in (right, second, wrong, missed)] == [False, False, True, False]
    assert ["cogging" in one.reported for one in (right, second, wrong)] == [True, True, False]
    scores = [right, second, wrong, missed]
    assert value(scores, "right name first, 10-25 %").startswith("25.0 % (1/4")
    assert value(scores, "truth inside the reported set").startswith("66.7 % (2/3")
    assert value(scores, "mean set size").startswith("1.33")
    small = score_case(truth("cogging", size=0.05), result("effect_found", "cogging"))
    assert value([*scores, small], "right name first, 5 %").startswith("100.0 % (1/1")


def test_an_added_wrong_name_is_confidently_wrong() -> None:
    score = score_case(truth("cogging"), result("effect_found", "cogging", "offset"))
    assert score.first == "cogging"
    assert score.is_confidently_wrong


def test_outside_and_two() -> None:
    told = score_case(truth("grease_ridge", is_inside=False), result("unknown_effect"))
    named = score_case(truth("grease_ridge", is_inside=False), result("effect_found", "cogging"))
    assert value([told, named], "outside the catalogue, reported as unknown").startswith("50.0 %")
    both = score_case(truth("cogging", "offset"), result("effect_found", "offset", "cogging"))
    one = score_case(truth("cogging", "offset"), result("effect_found", "offset"))
    none = score_case(truth("cogging", "offset"), result("unknown_effect"))
    assert value([both, one, none], "two effects: both").startswith("33.3 %")
    assert value([both, one, none], "two effects: at least one").startswith("66.7 %")


def test_gap() -> None:
    assert closure(6.0, 2.0, 1.0) == pytest.approx(0.8)
    assert closure(1.05, 1.0, 1.0) is None
    score = score_case(truth("offset"), result("effect_found", "offset", before=6.0, after=2.0, floor=1.5), floor=1.0)
    assert score.closure == pytest.approx(0.8)
    own = score_case(truth("offset"), result("effect_found", "offset", before=6.0, after=2.0, floor=2.0))
    assert own.closure == 1.0
    assert score_case(truth("offset"), result("effect_found", "offset", before=2.0, after=2.1, floor=1.0)).is_worse
    assert not score_case(truth("offset"), result("effect_found", "offset", before=2.0, after=2.0, floor=1.0)).is_worse
    assert score_case(truth("offset"), result("effect_found", "offset")).closure is None
    assert lower_tenth([float(i) for i in range(1, 21)]) == 2.0


def test_parameters() -> None:
    found = {"pitch": 0.0101, "amplitude": -1.9, "phase": 0.0}
    scores = compare("cogging", found, {"pitch": 1.0e-4, "amplitude": 0.01}, {"pitch": 0.01, "amplitude": 2.0})
    assert [one.error for one in scores] == pytest.approx([0.01, 0.05])
    assert [one.is_covered for one in scores] == [True, False]
    gain = compare("actuator_gain", {"gain": 0.81}, {}, {"gain": 0.8})[0]
    assert (gain.error, gain.is_covered) == (pytest.approx(0.05), None)
    assert compare("stribeck", {"share": 1.0}, {}, {"share": 1.0}) == []


def test_wrong_verdict_is_refused() -> None:
    with pytest.raises(ValueError, match="verdict"):
        score_case(truth(), {"verdict": "perhaps"})


def test_confusion(tmp_path: Path) -> None:
    scores = [
        score_case(truth("cogging"), result("effect_found", "cogging")),
        score_case(truth("cogging"), result("effect_found", "spring")),
        score_case(truth(), result("no_effect")),
        score_case(truth("grease_ridge", is_inside=False), result("unknown_effect")),
        score_case(truth("cogging", "offset"), result("unknown_effect")),
    ]
    rows, columns, counts = matrix(scores)
    assert rows == ["cogging", "grease_ridge", "nothing"]
    assert counts.sum() == 4
    assert counts[0, columns.index("spring")] == 1
    assert counts[2, columns.index("no_effect")] == 1
    assert "cogging" in confusion_text(scores)
    confusion_picture(scores, tmp_path / "confusion.png")
    assert (tmp_path / "confusion.png").stat().st_size > 1000
    assert "| cogging | 10-25 % | 2 | 1 | 1 | spring 1 | - |" in per_effect_text(scores)
    assert table_text(figures(scores)).count("\n") == 16
