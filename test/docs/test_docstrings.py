"""Every argument of the public interface, and of whole folders behind it, is described, with its unit."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from docstrings import arguments, described, undocumented

ROOT = Path(__file__).resolve().parents[2]

PAGE = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
TABLE = re.findall(r"^\| (`s[\w.]+`(?:, `s[\w.]+`)*) \|", PAGE, re.MULTILINE)
INTERFACE = {name for row in TABLE for name in re.findall(r"`([\w.]+)`", row)}
#: Folders that are held to the same inside.
WHOLE = ("bags", "fleet", "nodes", "observer")
INNER = {
    f"sgms_observer.{folder}.{path.stem}" for folder in WHOLE for path in (ROOT / "sgms_observer" / folder).glob("*.py")
}
MODULES = sorted(INTERFACE | INNER)
SOURCES = sorted([*ROOT.glob("sgms_observer/**/*.py"), *ROOT.glob("sim_plant/**/*.py")])


def test_the_page_names_the_interface() -> None:
    assert len(INTERFACE) > 20
    assert [name for name in INTERFACE if not (ROOT / f"{name.replace('.', '/')}.py").is_file()] == []


@pytest.mark.parametrize("module", MODULES)
def test_every_argument_is_described_with_its_unit(module: str) -> None:
    found = arguments(ROOT / f"{module.replace('.', '/')}.py")
    silent = [f"{one.owner}({one.name})" for one in found if one.text is None]
    assert silent == [], "describe it in the docstring's Args or Attributes"
    unitless = [f"{one.owner}({one.name}): {one.text}" for one in found if one.needs_unit and not one.has_unit]
    assert unitless == [], "give the unit in brackets, [-] for none"


def test_everything_public_has_a_docstring() -> None:
    silent = [f"{path.relative_to(ROOT)}: {name}" for path in SOURCES for name in undocumented(path)]
    assert silent == []


def test_nothing_is_left_to_be_written() -> None:
    marks = re.compile(r"\b(TODO|FIXME|XXX)\b")
    assert [str(path.relative_to(ROOT)) for path in SOURCES if marks.search(path.read_text(encoding="utf-8"))] == []


def test_the_check_reads_docstrings_as_people_do() -> None:
    says = described(
        "Sum.\n\nArgs:\n    a: one [m],\n        and more.\n    b, c: two [N].\n\nReturns:\n    d: nothing of ours.\n"
    )
    assert says == {"a": "one [m], and more.", "b": "two [N].", "c": "two [N]."}
