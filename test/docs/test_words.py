"""What README and docs name is there: links, commands and their options, files, targets, settings, topics."""

from __future__ import annotations

import argparse
import re
import subprocess
from dataclasses import fields
from pathlib import Path

import pytest

from sgms_observer.cli.main import COMMANDS, load_command, main
from sgms_observer.observer.outgoing import HORIZON, JOINT_STATE_TOPICS, PARAMETERS
from sgms_observer.settings.axis import AxisSettings

ROOT = Path(__file__).resolve().parents[2]

PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
TEXTS = {page: page.read_text(encoding="utf-8") for page in PAGES}
README = TEXTS[ROOT / "README.md"]
GROUPS = ("friction", "filter", "estimator", "compensation")


def _blocks(text: str) -> list[str]:
    """Return the lines of all code blocks without a language, continued lines joined."""
    blocks = re.findall(r"^ *```\n(.*?)^ *```", text, re.DOTALL | re.MULTILINE)
    return "\n".join(blocks).replace("\\\n", "").splitlines()


def _options(name: str) -> set[str]:
    """Return the options of a command."""
    command = load_command(name)
    assert command is not None
    parser = argparse.ArgumentParser()
    command.add_arguments(parser)
    return {option for action in parser._actions for option in action.option_strings}


def _anchors(page: Path) -> set[str]:
    headings = re.findall(r"^#+ (.+)$", TEXTS[page], re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\(([^)]+)\)", TEXTS[page]):
        if target.startswith(("http:", "https:")):
            continue
        name, _, anchor = target.partition("#")
        found = (page.parent / name).resolve() if name else page
        assert found.exists(), target
        if anchor:
            assert anchor in _anchors(found), target


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_commands_take_the_options_they_are_shown_with(page: Path) -> None:
    shown = re.findall(r"^(?:ros2 run sgms_observer )?sgms (.+)$", "\n".join(_blocks(TEXTS[page])), re.MULTILINE)
    shown += re.findall(r"`sgms ([^`]+)`", TEXTS[page])
    for words in (line.split() for line in shown if not line.startswith("…")):  # … stands for any command in messages
        if words[0] in COMMANDS:
            used = {word.split("=")[0] for word in words[1:] if word.startswith("--")}
            assert used - {"--help", "--version"} <= _options(words[0]), words
        else:
            assert words[0] in COMMANDS or words[0].startswith("-"), words


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_help(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as left:
        main([name, "--help"])
    assert left.value.code == 0
    said = capsys.readouterr().out
    assert said.startswith(f"usage: sgms {name}")
    unexplained = re.findall(r"^  (-{1,2}\w[\w-]*(?: \S+)?)\s*$(?!\n {10,}\S)", said, re.MULTILINE)
    assert unexplained == []


def test_commands_page_lists_every_command() -> None:
    table = TEXTS[ROOT / "docs" / "commands.md"].split("\n## ")[0]
    assert set(re.findall(r"`sgms (\w+)", table)) == set(COMMANDS)


def test_readme_lists_every_topic_of_the_observer() -> None:
    table = README.split("## Topics")[1].split("\n## ")[0]
    outputs = set(re.findall(r"^\| `(\S+)` \|", table, re.MULTILINE))
    assert outputs == {*JOINT_STATE_TOPICS, HORIZON, PARAMETERS, "/diagnostics"}


def test_readme_says_why_each_dependency_is_there() -> None:
    setup = (ROOT / "setup.py").read_text(encoding="utf-8")
    runtime = re.findall(r'"([\w-]+)[<>=]', setup.split("RUNTIME = [")[1].split("]")[0])
    assert len(runtime) > 5
    table = README.split("## What it depends on")[1]
    assert [name for name in runtime if f"| {name} |" not in table] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_files_and_targets_that_are_named_exist(page: Path) -> None:
    text = TEXTS[page]
    for name in re.findall(r"(?<![\w/.-])((?:config|launch|benchmarks|examples|tools|docs)/[\w/.-]+\.\w+)", text):
        assert (ROOT / name).exists(), name
    for name in re.findall(r"ros2 launch sgms_observer ([\w.]+)", text):
        assert (ROOT / "launch" / name).exists(), name
    targets = re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    for name in re.findall(r"^ *make ([a-z]+)|`make ([a-z]+)`", text, re.MULTILINE):
        assert "".join(name) in targets, name


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_settings_that_are_named_exist(page: Path) -> None:
    known = {part.name: {leaf.name for leaf in fields(type(getattr(AxisSettings(), part.name)))}
             for part in fields(AxisSettings) if part.name in GROUPS}  # fmt: skip
    for group, name in re.findall(rf"`(?:\w\.)?({'|'.join(GROUPS)})\.(\w+)", TEXTS[page]):
        is_module = (ROOT / "sgms_observer" / group / f"{name}.py").exists()
        assert is_module or name in known[group], f"{group}.{name}"


def test_changelog_is_current() -> None:
    import sgms_observer

    text = (ROOT / "CHANGELOG.rst").read_text(encoding="utf-8")
    newest = re.findall(r"^(Forthcoming|\d+\.\d+\.\d+)", text, re.MULTILINE)[0]
    assert newest in ("Forthcoming", sgms_observer.__version__)
    assert [name for name in COMMANDS if f"sgms {name}" not in text] == []


def test_no_path_of_a_machine_is_in_the_repository() -> None:
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True)
    if listed.returncode != 0:
        pytest.skip("not a git clone")
    machine = re.compile(r"(?<![\w.~])/(?:home|root|work|Users|mnt)/\w")
    found = []
    for name in listed.stdout.splitlines():
        path = ROOT / name
        if path.is_file() and path != Path(__file__) and path.suffix not in (".png", ".gz"):
            found += [f"{name}: {hit}" for hit in machine.findall(path.read_text(encoding="utf-8", errors="replace"))]
    assert found == []
