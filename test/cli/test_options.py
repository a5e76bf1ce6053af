"""Options mean the same in every command, and shells complete what the parsers know."""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from sgms_observer.bags.conversion import Table, write_table
from sgms_observer.bags.reader import read_joint_states
from sgms_observer.cli import main as command_line
from sgms_observer.cli.commission import TOPICS
from sgms_observer.cli.main import main
from sgms_observer.cli.options import live_topics_from
from sgms_observer.errors import ConfigurationError
from sgms_observer.outcome import EXIT_NOT_USABLE, Outcome, json_value

WRITING = (
    "commission",
    "demo",
    "simulate",
    "replay",
    "record",
    "convert",
    "init",
    "identify",
    "diagnose",
    "paper",
    "excite",
    "bench",
    "export",
)
WITH_RESULT = (
    "commission",
    "demo",
    "info",
    "check",
    "init",
    "convert",
    "identify",
    "diagnose",
    "simulate",
    "replay",
    "excite",
    "export",
    "record",
    "play",
    "paper",
)
WITH_BAG = ("replay", "info", "check", "init", "identify")


def actions(name: str) -> dict[str, argparse.Action]:
    """Return the options of a command."""
    command = command_line.load_command(name)
    assert command is not None
    parser = argparse.ArgumentParser()
    command.add_arguments(parser)
    return {option: action for action in parser._actions for option in action.option_strings}


@pytest.mark.parametrize("name", WRITING)
def test_every_command_that_writes_takes_overwrite(name: str) -> None:
    assert actions(name)["--overwrite"].default is False


@pytest.mark.parametrize("name", [name for name in command_line.COMMANDS if name != "completion"])
def test_every_command_can_be_quiet(name: str) -> None:
    assert "--quiet" in actions(name)
    assert (actions(name).get("--json") is not None) == (name in WITH_RESULT or name == "bench")


def test_axis_and_topic_are_declared_alike() -> None:
    for option in ("--axis", "--topic"):
        found = [actions(name)[option] for name in WITH_BAG]
        assert len({(type(one), one.metavar, str(one.default)) for one in found}) == 1
    assert {str(actions(name)["--topic"].default) for name in (*WITH_BAG, "play")} == {"[]"}
    assert type(actions("diagnose")["--axis"]) is type(actions("excite")["--axis"]) is type(actions("info")["--axis"])


@pytest.mark.parametrize("name", ["identify", "diagnose"])
@pytest.mark.parametrize(
    "holdout",
    [["--holdout", "b", "c"], ["--holdout", "b", "--holdout", "c"], ["--holdout=b", "--holdout", "c"]],
    ids=" ".join,
)
def test_several_recordings_to_judge_on(name: str, holdout: list[str]) -> None:
    args = command_line.build_parser(name).parse_args([name, "a", *holdout, "--config", "x.yaml", "--out", "y"])
    assert (args.bags, args.holdout) == (["a"], ["b", "c"])


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ("position", "must read KEY=NAME"),
        ("speed=/x", "speed is none of position, control_effort, reference, friction_compensation"),
        ("position=/joint states", "is no topic name of ROS"),
        ("position=3", "is no topic name of ROS"),
    ],
)
def test_topics_of_the_live_graph_are_names_of_ros(given: str, sentence: str) -> None:
    with pytest.raises(ConfigurationError, match=sentence):
        live_topics_from([given], TOPICS)
    named = {"position": "/joint_states", "reference": "axis/command"}
    assert live_topics_from([f"{key}={name}" for key, name in named.items()], TOPICS) == named


def test_excite_needs_topics_to_publish_only(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = ["--config", "none.yaml", "--out", str(tmp_path / "x.csv"), "--topic", "reference=/axis/command"]
    assert main(["excite", *options]) == 1
    assert "--publish" in capsys.readouterr().err


def bag(path: Path, value: float) -> str:
    """Write a bag of three samples."""
    stamps = 1_000_000_000 + 1_000_000 * np.arange(3)
    write_table(Table(stamps, np.full(3, value), np.zeros(3), None, None, ()), path, "x")
    return str(path)


def test_convert_replaces_bags_only_when_told_and_nothing_else_ever(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / "log.csv"
    log.write_text("t,x\n" + "".join(f"{k},{k}\n" for k in range(10)))
    arguments = ["convert", str(log), "--out", bag(tmp_path / "bag", 7.0), "--map", "time=t", "position=x"]
    assert main(arguments) == 1
    assert "give another name, or --overwrite" in capsys.readouterr().err
    assert read_joint_states(tmp_path / "bag", "position").position[0, 0] == 7.0
    assert main([*arguments, "--overwrite", "--map", "control_effort=none"]) == 1  # a fault leaves what was there
    assert read_joint_states(tmp_path / "bag", "position").position[0, 0] == 7.0
    assert main([*arguments, "--overwrite"]) == 0
    assert read_joint_states(tmp_path / "bag", "position").position[:, 0].tolist() == list(range(10))
    (tmp_path / "bag" / "thesis.tex").write_text("years of work")
    assert main([*arguments, "--overwrite"]) == 1
    assert "is no bag" in capsys.readouterr().err
    assert (tmp_path / "bag" / "thesis.tex").read_text() == "years of work"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bag", "log.csv"]


def test_split_writes_two_bags_or_none(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = tmp_path / "log.csv"
    log.write_text("t,x\n" + "".join(f"{k},{k}\n" for k in range(10)))
    arguments = ["convert", str(log), "--out", str(tmp_path / "bag"), "--map", "time=t", "position=x", "--json"]
    bag(tmp_path / "bag_rest", 7.0)
    assert main([*arguments, "--split", "0.5"]) == 1
    assert not (tmp_path / "bag").exists()
    capsys.readouterr()
    assert main([*arguments, "--split", "0.5", "--from", "1", "--to", "9", "--overwrite"]) == 0
    written = json.loads(capsys.readouterr().out)["bags"]
    assert [(Path(one["path"]).name, one["samples"]) for one in written] == [("bag", 4), ("bag_rest", 4)]


def test_json_is_all_that_is_printed_and_the_code_is_kept(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    class Command:
        HELP = "test"

        def add_arguments(self, parser: argparse.ArgumentParser) -> None:
            parser.add_argument("--json", action="store_true")
            parser.add_argument("--quiet", action="store_true")

        def run(self, args: argparse.Namespace) -> Outcome:
            print("for people")
            return Outcome(EXIT_NOT_USABLE, {"value": np.float64("nan"), "list": (np.arange(2),)})

    monkeypatch.setattr(command_line, "load_command", lambda name: Command())
    assert command_line.main(["demo", "--json"]) == 3
    assert json.loads(capsys.readouterr().out) == {"value": None, "list": [[0, 1]]}
    assert command_line.main(["demo", "--quiet"]) == 3
    assert capsys.readouterr().out == ""
    assert command_line.main(["demo"]) == 3
    assert capsys.readouterr().out == "for people\n"


def test_paper_prints_its_tables_as_json(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from sgms_observer.paper import best_configuration, figures, report, table
    from sgms_observer.report import page

    for module, name, value in (
        (table, "table_two", {"rows": [1.5]}), (table, "table_markdown", "table"),
        (best_configuration, "beyond", {"ekf": 0.5}), (best_configuration, "beyond_markdown", "beyond"),
        (figures, "figure_two", []), (figures, "figure_three", []), (figures, "figure_five", None),
        (figures, "figures_six_and_seven", []), (report, "paper_page", None), (page, "write_page", None),
    ):  # fmt: skip
        monkeypatch.setattr(module, name, lambda *_, value=value: value)
    out = tmp_path / "paper"
    assert main(["paper", "--out", str(out), "--seeds", "2", "--json"]) == 0
    expected = {"schema": 1, "folder": str(out), "table2": {"rows": [1.5]}, "beyond": {"ekf": 0.5}}
    assert json.loads(capsys.readouterr().out) == expected
    assert json.loads((out / "table2.json").read_text(encoding="utf-8")) == expected["table2"]


def test_json_value_is_plain() -> None:
    value = json_value({"a": np.int64(3), "b": [float("inf"), None, True], 4: "text"})
    assert json.dumps(value) == '{"a": 3, "b": [null, null, true], "4": "text"}'


@pytest.mark.skipif(shutil.which("bash") is None, reason="there is no bash here")
@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["conv"], {"convert"}),
        (["init", "--jo"], {"--joint-type"}),
        (["init", "--joint-type", "rev"], {"revolute"}),
        (["convert", "--"], set(actions("convert")) - {"-h"} | {"--help"}),
        (["completion", ""], {"bash", "zsh"}),
        (["info", "some_file"], set()),  # the shell's own completion of files follows
    ],
)
def test_bash_completes(
    words: list[str], expected: set[str], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert main(["completion", "bash"]) == 0
    script = tmp_path / "completion.bash"
    script.write_text(capsys.readouterr().out)
    line = (
        f"source {script}; COMP_WORDS=(sgms {' '.join(repr(word) for word in words)}); COMP_CWORD={len(words)}; _sgms"
    )
    done = subprocess.run(["bash", "-c", f'{line}; printf "%s\\n" "${{COMPREPLY[@]}}"'], capture_output=True, text=True)
    assert done.stderr == ""
    assert set(done.stdout.split()) == expected


@pytest.mark.skipif(shutil.which("zsh") is None, reason="there is no zsh here")
def test_zsh_reads_the_script(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert main(["completion", "zsh"]) == 0
    script = tmp_path / "completion.zsh"
    script.write_text(capsys.readouterr().out)
    done = subprocess.run(
        ["zsh", "-fc", f"autoload -U compinit && compinit -u; source {script}"], capture_output=True, text=True
    )
    assert (done.returncode, done.stderr) == (0, "")
