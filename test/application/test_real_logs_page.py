"""docs/real_logs.md: its commands lead from raw files to models, and its table is what the benchmark prints."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from machines import MACHINES, needs_machines
from program import load_script

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "real_logs.md").read_text(encoding="utf-8")
PUBLISHED_VISCOUS, PUBLISHED_COULOMB = 20.22, 13.27  # N m s/rad, N m: Mamedov, dynamic_calibration, UR10e joint 2
ONCE = "reverses once"
REFUSED = {
    "KR300, axis 1": ONCE, "Pan-tilt unit": "use a finer encoder",
    "KR300, axis 3": ONCE, "KR300, axis 4": ONCE, "KR300, axis 6": ONCE,
}  # fmt: skip
SOME_BLIND = ("Cart on a rail, at 0.20 m", "Electric cylinder, other sweep")  # the others take as long each


BENCHMARK = load_script("benchmarks/real_logs.py")
BY_NAME = {machine.name: machine for machine in BENCHMARK.machines_of(PAGE)}
BLIND = {machine.name: machine for machine in BENCHMARK.blind_machines_of(PAGE)}


def _table() -> dict[str, list[str]]:
    """Return the cells of the page's tables of figures by machine."""
    rows = re.findall(r"^\| ([^|]+) \| ([\d.-]+) \| ([^|]+) \| ([^|]+) \| ([^|]+) \| ([^|]+) \|$", PAGE, re.MULTILINE)
    return {row[0]: list(row[1:]) for row in rows}


@cache
def _row(name: str) -> Any:
    """Return the line of the table that the commands give; run once for all tests."""
    return BENCHMARK.judged({**BY_NAME, **BLIND}[name], MACHINES)


def test_the_page_has_commands_and_a_line_of_the_table_for_each_machine() -> None:
    folders = {re.search(r"\$MACHINES/(\w+)/", " ".join(machine.commands[0]))[1] for machine in BY_NAME.values()}  # type: ignore[index]
    assert folders == {"ur10e", "kr300", "cart", "electric_cylinder", "pan_tilt"}
    assert set(_table()) == {*BY_NAME, *BLIND}


def test_blind_logs_are_none_of_those_above() -> None:
    def raw(machines: dict) -> set[tuple[str, ...]]:
        return {machine.commands[0][1:] for machine in machines.values()}

    assert len(raw(BLIND)) == len(BLIND) and not raw(BLIND) & raw(BY_NAME)


@needs_machines
@pytest.mark.parametrize("name", [*(name for name in BY_NAME if name not in REFUSED), *SOME_BLIND])
def test_the_table_is_what_the_commands_give(name: str) -> None:
    row = _row(name)
    told = [float(cell) for cell in _table()[name]]
    found = [row.band, row.this_tool, row.coulomb_viscous, row.stribeck, row.lugre]
    assert found == pytest.approx(told, abs=0.3)
    assert row.said in ("exit 0", "exit 3")
    if name.startswith("UR10e"):
        assert row.this_tool <= 1.1 * row.coulomb_viscous  # least squares with sin q and cos q


@needs_machines
@pytest.mark.parametrize("name", list(REFUSED))
def test_what_a_recording_cannot_show_is_refused_with_a_sentence(name: str, tmp_path: Path) -> None:
    code, out, said = BENCHMARK.run_commands({**BY_NAME, **BLIND}[name], MACHINES, tmp_path)
    assert code == 1 and not out
    assert _table()[name] == ["-", "refused", "-", "-", "-"]
    assert REFUSED[name] in said


@needs_machines
def test_friction_of_the_ur10e_joint_is_that_published() -> None:
    row = _row("UR10e, joint 2")
    assert row.said == "exit 0"
    assert row.parameters["friction.viscous_coefficient"]["value"] == pytest.approx(PUBLISHED_VISCOUS, rel=0.15)
    assert row.parameters["friction.coulomb_force"]["value"] == pytest.approx(PUBLISHED_COULOMB, rel=0.15)
