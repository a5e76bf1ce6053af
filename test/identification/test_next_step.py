"""The page of an identification gives the next command with the names of the run."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from sgms_observer.identification.report import _next_steps


def part(name: str, is_usable: bool = True) -> Any:
    """Return what the next step needs of an identified axis."""
    return SimpleNamespace(name=name, answer=SimpleNamespace(is_usable=is_usable))


@pytest.mark.parametrize(
    ("parts", "held_out", "has_other_axes", "commands"),
    [
        ([part("x")], [], False, ["sgms diagnose first --config out.yaml --holdout OTHER --out diagnosis"]),
        ([part("x")], ["my log"], True,
         ["sgms diagnose first --config out.yaml --holdout 'my log' --axis x --out diagnosis_x"]),
        ([part("x"), part("y"), part("z", is_usable=False)], ["second"], False,
         ["sgms diagnose first --config out.yaml --holdout second --axis x --out diagnosis_x",
          "sgms diagnose first --config out.yaml --holdout second --axis y --out diagnosis_y"]),
        ([part("x", is_usable=False)], [], False, []),
    ],
)  # fmt: skip
def test_the_next_command_has_the_names_of_the_run(
    parts: list[Any], held_out: list[str], has_other_axes: bool, commands: list[str]
) -> None:
    text = _next_steps(parts, "out.yaml", ["first"], held_out, has_other_axes)
    assert [line for line in text if line.startswith("sgms diagnose")] == commands
    refused = [one.name for one in parts if not one.answer.is_usable]
    assert [line.split(":")[0] for line in text if line.startswith("Do not")] == [
        f"Do not use the model of {name}" for name in refused
    ]
