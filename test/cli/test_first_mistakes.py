"""What a newcomer gets wrong: each mistake ends in one sentence that says what, where, and what to do."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import numpy as np
import pytest
from c_build import needs

from sgms_observer import whole_file
from sgms_observer.application import kernels
from sgms_observer.bags.writer import BagWriter
from sgms_observer.cli.main import main
from sgms_observer.errors import DataError, RecordingError
from sgms_observer.nodes import conductor

NO_AXES = "/**: {ros__parameters: {sample_period: 1.0e-3}}"
NO_MASS = "/**: {ros__parameters: {axes: [x], x: {estimator: {kind: ekf}}}}"
WHOLE = "/**: {ros__parameters: {axes: [x], x: {mass: 3.0, estimator: {kind: ekf}}}}"


def _file(folder: Path, text: str) -> str:
    path = folder / "axis.yaml"
    path.write_text(text, encoding="utf-8")
    return str(path)


@pytest.mark.parametrize(("text", "sentence"), [(NO_AXES, "axes must be given"), (NO_MASS, "x.mass must be given")])
@pytest.mark.parametrize(
    "command",
    [
        ("check",),
        ("export", "--target", "c"),
        ("export", "--target", "fmu"),
        ("commission", "--yes"),
        ("replay", "bag"),
        ("replay", "bag", "bag2"),
        ("diagnose", "bag"),
        ("diagnose", "bag", "bag2", "--each"),
        ("demo",),
        ("simulate",),
        ("excite",),
    ],
    ids=" ".join,
)
def test_a_file_without_its_machine_is_refused_before_anything_is_written(
    text: str, sentence: str, command: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The nodes refuse it as well: numbers of an example drive nobody's machine."""
    name, *options = command
    config = [_file(tmp_path, text)] if name in ("check", "export") else ["--config", _file(tmp_path, text)]
    out = ["--out", str(tmp_path / "out")] if name != "check" else []
    assert main([name, *config, *options, *out]) == 1
    printed = capsys.readouterr()
    assert printed.err.startswith(sentence) and printed.err.count("\n") == 1 and printed.out == ""
    assert [path.name for path in tmp_path.iterdir()] == ["axis.yaml"]


def test_an_identification_needs_the_axes_of_its_start_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It identified an axis x of an example; a mass may be missing, because it is what the recordings show."""
    assert main(["identify", "bag", "--config", _file(tmp_path, NO_AXES), "--out", str(tmp_path / "out.yaml")]) == 1
    assert capsys.readouterr().err.startswith("axes must be given")
    assert [path.name for path in tmp_path.iterdir()] == ["axis.yaml"]


@pytest.mark.parametrize("command", [["demo"], ["commission", "--yes", "--config"]])
def test_kernels_that_were_not_compiled_ahead_are_warned_of(
    command: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The nodes then compile while they run, and the command must say why it is slow."""
    pytest.importorskip("rclpy")
    from sgms_observer.nodes import table_link

    def stop(*_: object) -> int:
        raise DataError("the test stops here")

    monkeypatch.setattr(kernels, "compile_ahead", lambda show: "the kernels of stage could not be compiled ahead")
    monkeypatch.setattr(conductor, "prepare_graph", stop)
    monkeypatch.setattr(table_link, "TableLink", stop)
    given = [_file(tmp_path, WHOLE)] if command[-1] == "--config" else []
    assert main([*command, *given, "--out", str(tmp_path / "out")]) == 1
    said = capsys.readouterr().err.splitlines()
    assert said[-2:] == ["Warning: the kernels of stage could not be compiled ahead", "the test stops here"]


@needs("cc")
@pytest.mark.parametrize("name", ["stage", "stage.fmu"])
def test_an_fmu_of_another_name_is_warned_of(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / name
    assert main(["export", _file(tmp_path, WHOLE), "--target", "fmu", "--out", str(out)]) == 0
    assert out.is_file()
    warning = f"Warning: {out} does not end in .fmu; rename it for tools that ask for it\n"
    assert capsys.readouterr().err == (warning if name == "stage" else "")


def test_an_export_does_not_replace_a_package_of_the_user(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    package, config = tmp_path / "mine", _file(tmp_path, WHOLE)
    package.mkdir()
    (package / "package.xml").write_text("<package><name>mine</name></package>", encoding="utf-8")
    export = ["export", config, "--target", "ros2_control", "--overwrite", "--out"]
    assert main([*export, str(package)]) == 1
    assert "was not written by sgms export" in capsys.readouterr().err
    assert [path.name for path in package.iterdir()] == ["package.xml"]
    for _ in range(2):
        assert main([*export, str(tmp_path / "exported")]) == 0


def test_an_excitation_does_not_replace_its_parameter_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    config = _file(tmp_path, WHOLE)
    assert main(["excite", "--config", config, "--out", config, "--overwrite"]) == 1
    assert capsys.readouterr().err.endswith("is the parameter file itself, which stays; give another name\n")
    assert Path(config).read_text(encoding="utf-8") == WHOLE


@pytest.mark.parametrize("target", ["c", "ros2_control", "fmu"])
def test_an_export_does_not_replace_a_file(target: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    config = _file(tmp_path, WHOLE)
    assert main(["export", config, "--target", target, "--out", config, "--overwrite"]) == 1
    assert capsys.readouterr().err.endswith(
        "was not written by sgms export and is not overwritten; give another name\n"
    )
    assert Path(config).read_text(encoding="utf-8") == WHOLE


@pytest.mark.parametrize("name", ["joint states", "3", "/a//b", "/a/"])
def test_a_recorder_asks_for_names_of_topics(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("rclpy")
    assert main(["record", name, "--out", str(tmp_path / "bag"), "--duration", "1"]) == 1
    assert capsys.readouterr().err.startswith(f"{name} is no topic name of ROS; ")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["convert", "log.csv", "--map", "time=t", "position=q", "--from=-1"], "--from -1 s must not be negative; "),
        (["convert", "log.csv", "--map", "time=t", "position=q", "--to=nan"], "--to nan s must not be negative; "),
        (["excite", "--config", "axis.yaml", "--duration=inf"], "duration = inf s is too long for a recording; "),
        (["excite", "--config", "axis.yaml", "--rate=1e30"], "rate = 1e+30 Hz is too high for set-points; "),
        (["init", "--position-scale=nan"], "--position-scale and --effort-scale must be finite and not 0; "),
        (["record", "--duration=inf"], "--duration inf s must be a positive number; "),
        (["record", "--duration=-1"], "--duration -1 s must be a positive number; "),
        (["info", "empty"], "empty is no bag: "),
    ],
)
def test_a_number_that_makes_no_sense_is_refused(
    arguments: list[str],
    sentence: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """A window from -1 s on was the whole log, an infinite excitation an internal error, and a recording had no end."""
    if arguments[0] == "record":
        pytest.importorskip("rclpy")
    monkeypatch.chdir(tmp_path)
    _file(tmp_path, WHOLE)
    Path("log.csv").write_text("t,q\n0,0\n0.001,1e-6\n0.002,2e-6\n", encoding="utf-8")
    Path("empty").mkdir()
    out = [] if arguments[0] == "info" else ["--out", "out"]
    assert main([*arguments, *out]) == 1
    said = capsys.readouterr().err
    assert said.startswith(sentence) and "; " in said and said.count("\n") == 1
    assert not Path("out").exists()


@pytest.mark.parametrize("options", [[], ["--overwrite"]], ids=["", "overwrite"])
@pytest.mark.parametrize(
    "command",
    [("diagnose", "other"), ("replay", "other", "third"), ("commission", "--yes"), ("demo",), ("paper",)],
    ids=" ".join,
)
def test_no_result_goes_into_the_folder_of_a_bag(
    command: tuple[str, ...], options: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A commissioning put its log and report there; the bag was none any more for what replaces bags."""
    with BagWriter(tmp_path / "bag") as bag:
        bag.write_joint_states("position", np.arange(3, dtype=np.int64) * 1_000_000, ("x",), position=np.zeros(3))
    before = {path.name: path.read_bytes() for path in (tmp_path / "bag").iterdir()}
    config = [] if command[0] == "paper" else ["--config", _file(tmp_path, WHOLE)]
    assert main([*command, *config, "--out", str(tmp_path / "bag"), *options]) == 1
    said = capsys.readouterr().err
    assert "is the folder of a bag, which stays as it is; " in said and said.count("\n") == 1
    assert {path.name: path.read_bytes() for path in (tmp_path / "bag").iterdir()} == before


@pytest.mark.parametrize("command", [("identify", "bag"), ("excite",)], ids=" ".join)
def test_a_folder_in_place_of_a_file_is_refused_before_any_work(
    command: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "out").mkdir()
    options = ["--config", _file(tmp_path, WHOLE), "--out", str(tmp_path / "out"), "--overwrite"]
    assert main([*command, *options]) == 1
    assert capsys.readouterr().err.endswith("is a folder where a file must be; give the name of a file\n")


def test_a_bag_below_a_file_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = tmp_path / "log.csv"
    log.write_text("t,q\n0,0\n0.001,1e-6\n", encoding="utf-8")
    assert main(["convert", str(log), "--out", str(log / "bag"), "--map", "time=t", "position=q"]) == 1
    sentence = "cannot be written: it is a file, or lies in one, where a folder must be; give another name\n"
    assert capsys.readouterr().err == f"{log / 'bag'} {sentence}"


@pytest.mark.parametrize(
    ("number", "remedy"),
    [(errno.EACCES, "choose a folder that you may write to"), (errno.ENOSPC, "make room or choose another folder")],
)
def test_a_folder_that_refuses_says_what_helps(
    number: int, remedy: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(Path, "touch", fail)
    with pytest.raises(RecordingError) as error:
        whole_file.try_folder(tmp_path)
    assert str(error.value) == f"{tmp_path} cannot be written: {os.strerror(number)}; {remedy}"


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["paper", "--out", "p", "--seeds", "abc"], "abc is no number of seeds"),
        (["paper", "--out", "p", "--seeds", "1"], "1 is no number of seeds"),
        (["simulate", "--config", "f", "--out", "b", "--duration", "ab"], "ab is no duration"),
        (["simulate", "--config", "f", "--out", "b", "--seed", "-1"], "-1 is no seed"),
    ],
)
def test_a_number_that_is_none_gets_a_sentence(
    arguments: list[str], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == 2
    assert sentence in capsys.readouterr().err


def test_init_says_of_positions_in_counts_that_a_scale_is_missing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A value that it derives from them is out of range, and there is no file in which to lower it."""
    time = 1e-3 * np.arange(20_000)
    stamps, counts = np.rint((1.0 + time) * 1e9).astype(np.int64), np.rint(1e6 * np.sin(3.0 * time))
    with BagWriter(tmp_path / "bag") as bag:
        bag.write_joint_states("position", stamps, ["x"], position=counts)
        bag.write_joint_states("control_effort", stamps, ["x"], effort=np.sign(np.cos(3.0 * time)))
    assert main(["init", str(tmp_path / "bag"), "--out", str(tmp_path / "x.yaml")]) == 1
    (sentence,) = capsys.readouterr().err.splitlines()
    assert "if in encoder counts the length of one count, as --position-scale" in sentence
    assert not (tmp_path / "x.yaml").exists()
