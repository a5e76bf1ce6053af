"""The pages about safety agree: which steps move the machine, the first limit, the gains, what stops a motion."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from sgms_observer.application.commission import compensate, table
from sgms_observer.application.commission.next_experiment import MAX_EXPERIMENTS
from sgms_observer.application.commission.run import STEPS
from sgms_observer.application.commission.session import REPEATS
from sgms_observer.application.init import FIRST_LIMIT_SHARE
from sgms_observer.settings.axis import CompensationSettings
from sgms_observer.settings.load import load_settings

ROOT = Path(__file__).resolve().parents[2]
PAGES = {path.name: path.read_text(encoding="utf-8") for path in [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]}
NUMBERS = {2: "two", 3: "three"}

LIMIT = f"{FIRST_LIMIT_SHARE:g} times the static force"
GAINS = [f"{share * CompensationSettings().gain:.1g}" for share in compensate.GAIN_STEPS]
SAFETY_PAGES = ("README.md", "quickstart.md", "commission.md", "deployment.md", "troubleshooting.md")
MOVING_BY_HAND = {"Record", "Compensate"}


def _flat(page: str) -> str:
    return " ".join(PAGES[page].split())


def _table(page: str, heading: str) -> dict[str, str]:
    """Return the second column of the table below a heading by its first, links and backticks removed."""
    body = PAGES[page].split(heading)[1].split("\n\n## ")[0]
    rows = [line.strip("|").split("|") for line in body.splitlines() if line.startswith("|")][2:]
    return {re.sub(r"\[(?:\d+\. )?|\]\(.*\)|`", "", row[0]).strip(): row[1].strip() for row in rows}


@pytest.mark.parametrize("page", SAFETY_PAGES)
def test_pages_give_one_first_limit_and_the_gains_of_commission(page: str) -> None:
    text = _flat(page)
    assert LIMIT in text
    first, second, third = GAINS
    assert re.search(rf"{first}(?:,| to)(?: then)? {second},? (?:and |then )*{third}", text)


ENABLES = re.compile(r"compensation\.enabled(?: |:=)true")


@pytest.mark.parametrize("page", [name for name, text in PAGES.items() if ENABLES.search(text)])
def test_each_page_that_enables_sets_the_first_gain_before(page: str) -> None:
    blocks = re.findall(r"^ *```\w*\n(.*?)^ *```", PAGES[page], re.DOTALL | re.MULTILINE)
    enabling = [block for block in blocks if ENABLES.search(block)]
    assert len(enabling) == len(ENABLES.findall(PAGES[page])), "enable in a block of commands, with its gain"
    for block in enabling:
        before = ENABLES.split(block)[0]
        assert re.findall(r"compensation\.gain(?: |:=)([\d.]+)", before)[-1:] == GAINS[:1]
    assert re.search(rf"{GAINS[1]},? (?:and )?(?:then )?(?:to )?{GAINS[2]}", _flat(page))


@pytest.mark.parametrize("page", PAGES)
def test_a_paragraph_that_enables_in_a_file_is_about_a_simulation(page: str) -> None:
    for paragraph in PAGES[page].split("\n\n"):
        if re.search(r"`compensation\.enabled` to `true`", paragraph):
            assert "simulation" in paragraph and f"starts at {GAINS[0]}" in " ".join(paragraph.split())


@pytest.mark.parametrize("path", sorted((ROOT / "config").glob("*.yaml")), ids=lambda path: path.stem)
def test_shipped_files_say_the_first_gain_and_where_another_limit_is_for(path: Path) -> None:
    axes = load_settings(path).axes if "ros__parameters" in path.read_text(encoding="utf-8") else ()
    for line in path.read_text(encoding="utf-8").splitlines():
        if re.match(r" *enabled: false", line) and path.stem in ("table", "joint", "ros2_control") and "#" in line:
            assert GAINS[0] in line
        if limit := re.match(r" *limit: ([\d.]+)", line):
            first = [FIRST_LIMIT_SHARE * axis.friction.static_force for axis in axes]
            is_first = any(float(limit.group(1)) == pytest.approx(one) for one in first)
            assert is_first or re.search("this (?:simulation|fixed data set)", line), line


def test_no_page_gives_another_first_limit() -> None:
    first = load_settings(ROOT / "config" / "table.yaml").axes[0].friction.static_force * FIRST_LIMIT_SHARE
    for name, text in PAGES.items():
        for given in re.findall(r"compensation\.limit (?:= )?([\d.]+)", text):
            assert float(given) == first, name
        other = re.findall(r"(\S+ times|a little above|twice) (?:the )?`?static[_ ]force", text)
        assert set(other) <= {f"{FIRST_LIMIT_SHARE:g} times"}, name


@pytest.mark.parametrize("name", ["table", "joint", "ros2_control"])
def test_shipped_files_have_the_first_limit(name: str) -> None:
    for axis in load_settings(ROOT / "config" / f"{name}.yaml").axes:
        assert axis.compensation.limit == pytest.approx(FIRST_LIMIT_SHARE * axis.friction.static_force)
        assert not axis.compensation.enabled


def test_commission_page_says_which_steps_move() -> None:
    said = _table("commission.md", "## The steps")
    assert {name: "yes" in moves for name, moves in said.items()} == {step.name: step.moves for step in STEPS}


@pytest.mark.parametrize(("page", "heading"), [("deployment.md", "step by step"), ("README.md", "## Deployment")])
def test_pages_say_which_steps_move_by_hand(page: str, heading: str) -> None:
    said = _table(page, heading)
    assert {name for name, moves in said.items() if "yes" in moves} == MOVING_BY_HAND


def test_each_step_by_hand_says_first_whether_it_moves() -> None:
    sections = re.split(r"^## \d\. ", PAGES["deployment.md"], flags=re.MULTILINE)[1:]
    assert len(sections) == len(_table("deployment.md", "step by step"))
    for section in sections:
        title, sentence = section.split("\n")[0], section.split("\n")[2]
        assert sentence.startswith("Moves the machine: "), title
        assert ("**yes**" in sentence) == (title in MOVING_BY_HAND), title


def test_order_is_the_same_by_hand_and_in_the_readme() -> None:
    by_hand = [name for name in _table("deployment.md", "step by step") if name != "Install"]
    assert by_hand == list(_table("README.md", "## Deployment"))
    in_command = [step.name for step in STEPS]
    shared = [name.lower() for name in by_hand if name.lower() in in_command]
    assert shared == [name for name in in_command if name in shared]
    assert len(shared) > 4


def test_no_page_counts_steps_that_only_listen() -> None:
    for name, text in PAGES.items():
        assert not re.search(r"(?i)steps? \d[^.]* only listen|everything before step|nothing is sent", text), name


def test_commission_page_gives_the_bounds_of_its_guard() -> None:
    from sgms_observer.nodes import table_link

    text = _flat("commission.md")
    for sentence in (
        f"stops arriving for {table_link.SILENCE:g} s",
        f"leaves the stroke by more than {100 * table.STROKE_MARGIN:g} %",
        f"moves more than {table.SPEED_MARGIN:g} times faster than allowed",
        f"further than {100 * table.LARGEST_LAG:g} % of the stroke from its reference",
        f"is played again, {NUMBERS[REPEATS]} times at most",
        f"for each set of effects {NUMBERS[MAX_EXPERIMENTS]} times at most | `recordings/experiment_1`",
        f"beyond {compensate.MAX_PEAK_RATIO:g} times the peak without it",
    ):
        assert sentence in text
