"""Logs into bags: the dialects of CSV, MAT files, the EMPS record, and one sentence for everything else."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from fresh_file import write_fresh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sgms_observer.application.convert import ConvertOptions, convert
from sgms_observer.bags.conversion import open_log, parse_map, read_table, write_table
from sgms_observer.bags.reader import BagSamples, read_joint_states, read_samples
from sgms_observer.cli.main import main
from sgms_observer.errors import RecordingError

EMPS = Path(os.environ.get("SGMS_DATA", Path(__file__).parents[3] / "shared" / "data")) / "emps"
if not EMPS.exists() and (EMPS.parent / "DATA_EMPS.mat").exists():
    EMPS = EMPS.parent
TABLE = np.column_stack([np.arange(5) * 0.001, np.arange(5) * 1e-6, np.array([0.5, -0.25, 1.0, 2.0, -3.0])])
MAP = {"time": "t", "position": "x", "control_effort": "u"}


def lines(delimiter: str, decimal: str = ".") -> list[str]:
    """Return the table's lines in a dialect."""
    return [delimiter.join(f"{value:.9g}".replace(".", decimal) for value in row) for row in TABLE]


@pytest.mark.parametrize(
    "content",
    [
        ["t,x,u", *lines(",")],
        ["t;x;u", *lines(";", ",")],
        ["# exported by a drive", "#", "# t\tx\tu", *lines("\t")],
        ["% t x u", *lines(" ")],
        ['"t";"x";"u"', "s;m;N", *lines(";")],
        ["t, x, u", *lines(", ")],
        ["t;x;u;", *[line + ";" for line in lines(";")]],
        ["\ufefft,x,u", "", *lines(",")],
    ],
)
def test_dialects_of_csv(tmp_path: Path, content: list[str]) -> None:
    path = tmp_path / "log.csv"
    path.write_text("\n".join(content) + "\n", encoding="utf-8")
    table = read_table(path, MAP)
    np.testing.assert_array_equal(table.stamp_ns, 1_000_000_000 + np.arange(5) * 1_000_000)
    np.testing.assert_allclose(table.position, TABLE[:, 1], rtol=1e-12)
    np.testing.assert_allclose(table.control_effort, TABLE[:, 2], rtol=1e-12)
    assert table.reference is None
    path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    np.testing.assert_array_equal(read_table(path, MAP).position, table.position)


def test_columns_of_whole_numbers_are_not_taken_for_decimals(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("t,x\n0,1\n1,2\n2,4\n")
    assert read_table(path, {"time": "t", "position": "x"}).position.tolist() == [1.0, 2.0, 4.0]


def test_columns_without_names_have_numbers(tmp_path: Path) -> None:
    path = tmp_path / "log.txt"
    path.write_text("\n".join(lines(" ")))
    table = read_table(path, {"time": "1", "position": "2*1e3", "control_effort": "3*-2*0.5"})
    np.testing.assert_allclose(table.position, TABLE[:, 1] * 1e3, rtol=1e-12)
    np.testing.assert_allclose(table.control_effort, -TABLE[:, 2], rtol=1e-12)


def test_latin_1_and_names_with_stars(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_bytes("t;Weg µm;a*b\n0;1;2\n1;2;3\n".encode("latin-1"))
    table = read_table(path, {"time": "t", "position": "Weg µm*1e-6", "control_effort": "a*b*2"})
    np.testing.assert_allclose(table.position, [1e-6, 2e-6])
    assert table.control_effort is not None and table.control_effort.tolist() == [4.0, 6.0]


def test_mat_files(tmp_path: Path) -> None:
    scipy_io = pytest.importorskip("scipy.io")
    path = tmp_path / "log.mat"
    scipy_io.savemat(
        path, {"t": TABLE[:, :1], "log": {"x": TABLE[:, 1], "k": 3.0}, "both": TABLE[:, 1:], "note": "words"}
    )
    assert {"t", "log.x", "log.k", "both(:,1)", "both(:,2)"} == set(open_log(path).names)
    table = read_table(path, {"time": "t", "position": "log.x*log.k", "control_effort": "both(:,2)"})
    np.testing.assert_allclose(table.position, 3.0 * TABLE[:, 1])
    np.testing.assert_array_equal(table.control_effort, TABLE[:, 2])
    whole = path.read_bytes()
    for size in [0, 10, 127, 128, 200, len(whole) // 2, len(whole) - 1]:
        write_fresh(path, whole[:size])
        try:
            read_table(path, {"time": "t", "position": "log.x"})
        except RecordingError as error:
            assert "\n" not in str(error)


@pytest.mark.skipif(not EMPS.exists(), reason="the EMPS records are not here")
@pytest.mark.parametrize("name", ["DATA_EMPS", "DATA_EMPS_PULSES"])
def test_the_emps_records(tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    loadmat = pytest.importorskip("scipy.io").loadmat
    out = tmp_path / "bag"
    arguments = ["convert", str(EMPS / f"{name}.mat"), "--out", str(out), "--axis", "table"]
    assert main([*arguments, "--map", "time=t", "position=qm", "control_effort=vir*gtau", "--map", "reference=qg"]) == 0
    assert "24841 samples of axis table, 24.84 s at 1000 Hz" in capsys.readouterr().out
    raw = {key: np.ravel(value) for key, value in loadmat(EMPS / f"{name}.mat").items() if not key.startswith("__")}
    blocks = list(read_samples(out, "table"))
    np.testing.assert_array_equal(np.concatenate([block.position for block in blocks]), raw["qm"])
    np.testing.assert_allclose(np.concatenate([block.effort for block in blocks]), raw["vir"] * raw["gtau"], rtol=1e-12)
    # The observer waits for a reference from the first one on that it sees, so the first sample may lack it.
    np.testing.assert_array_equal(np.concatenate([block.reference_position for block in blocks])[1:], raw["qg"][1:])
    stamps = np.concatenate([block.stamp_ns for block in blocks])
    np.testing.assert_allclose((stamps - stamps[0]) * 1e-9, raw["t"] - raw["t"][0], atol=1e-9)
    reference = read_joint_states(out, "reference")
    np.testing.assert_allclose(reference.velocity[:, 0], np.gradient(raw["qg"], raw["t"]), atol=1e-6)


def test_times_before_one_second_are_moved_and_later_ones_kept(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("t,x\n-0.002,1\n-0.001,2\n0,3\n")
    table = read_table(path, {"time": "t", "position": "x"})
    assert table.stamp_ns.tolist() == [1_000_000_000, 1_001_000_000, 1_002_000_000]
    assert "1.002 s was added to all times, because ROS reads a stamp of 0 as 'no stamp'" in table.notices
    path.write_text("t,x\n5,1\n5.001,2\n5.1,nan\n")
    table = read_table(path, {"time": "t", "position": "x"})
    assert table.stamp_ns.tolist() == [5_000_000_000, 5_001_000_000, 5_100_000_000]
    assert any("1 of 3 entries of position are NaN" in notice for notice in table.notices)
    write_table(table, tmp_path / "bag", "x", "sqlite3")
    assert read_joint_states(tmp_path / "bag", "position").stamp_ns.tolist() == table.stamp_ns.tolist()


@pytest.mark.parametrize(
    ("content", "items", "sentence"),
    [
        ("t,x\n0,1\n1,2\n", ["time=t"], "lacks position; add position=COLUMN"),
        ("t,x\n0,1\n1,2\n", ["time", "position=x"], "write KEY=COLUMN"),
        ("t,x\n0,1\n1,2\n", ["time=t", "position=x", "force=x"], "force is none of time, position"),
        ("t,x\n0,1\n1,2\n", ["time=t", "time=t", "position=x"], "gives time twice"),
        ("t,x\n0,1\n1,2\n", ["time=t", "position=y"], "no column y; it has t, x"),
        ("t,x\n0,1\n1,2\n", ["time=t", "position=x*k"], "no factor k"),
        ("t,x\n0,1\n1,2\n", ["time=t", "position=x*t"], "the factor t has 2 entries"),
        ("t,x\n0,1\n1,2\n", ["time=t", "position=x*0"], "the factor 0 is 0.0"),
        ("t,x\n0,1\n1,2\n0.5,3\n", ["time=t", "position=x"], r"sample 3 \(0.5 s\) does not follow sample 2"),
        ("t,x\n0,1\n0,2\n0,3\n1,3\n1,4\n", ["time=t", "position=x"], "3 of 5 samples repeat the time t"),
        ("t,x\n0,1\nnan,2\n", ["time=t", "position=x"], "not finite in sample 2"),
        ("t,x\n0,1\n", ["time=t", "position=x"], "two are needed"),
        ("t,x\n0,1\n1,2\n2,oops\n", ["time=t", "position=x"], "line 4 cannot be read, .*'oops'"),
        ("t,x\n0,1\n1,2\n2\n", ["time=t", "position=x"], "too few columns in line 4"),
        ("t,x\n0,1\n3e9,2\n", ["time=t", "position=x"], "beyond what a ROS stamp holds"),
        ("words\nonly\n", ["time=t", "position=x"], "log.csv holds no line of numbers; export the log again"),
        ("t,x,u\n", ["time=t", "position=x"], "log.csv holds no line of numbers; export the log again"),
        ("", ["time=t", "position=x"], "log.csv is empty; export the log again"),
        (" \n\n", ["time=t", "position=x"], "log.csv is empty; export the log again"),
    ],
)  # fmt: skip
def test_one_sentence_for_each_fault(tmp_path: Path, content: str, items: list[str], sentence: str) -> None:
    path = tmp_path / "log.csv"
    path.write_text(content)
    with pytest.raises(RecordingError, match=sentence) as caught:
        read_table(path, parse_map(items))
    assert "\n" not in str(caught.value)


def test_the_command_says_one_sentence_and_leaves_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["convert", str(tmp_path / "none.csv"), "--out", str(tmp_path / "bag"), "--map", "time=t", "position=x"]
    assert main(arguments) == 1
    assert "none.csv cannot be read: No such file" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@settings(max_examples=1000, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.one_of(st.binary(max_size=200), st.text('0123456789.,;\t \n-e#tx"', max_size=120).map(str.encode)))
def test_any_file_gives_a_table_or_one_sentence(tmp_path: Path, data: bytes) -> None:
    for name in ("any.csv", "any.mat"):
        path = tmp_path / name
        write_fresh(path, data)
        try:
            table = read_table(path, {"time": "1", "position": "2"})
        except RecordingError as error:
            assert "\n" not in str(error)
        else:
            assert np.all(np.diff(table.stamp_ns) > 0)


def test_a_position_that_jumps_is_told_in_one_sentence(tmp_path: Path) -> None:
    """``identify`` and ``diagnose`` tell it; who converts the log still has the machine at hand."""
    time = np.arange(6000) / 1000.0
    turning = np.mod(3.0 * time + 0.2 * np.sin(6.0 * time), 2.0 * np.pi)
    turning[[700, 2500]] += 0.5
    homed = 0.05 * np.sin(3.0 * time) + 0.113 * (time >= 2.0)
    kept = "; the bag keeps the positions as they are: identify and diagnose unwrap them, leave out single ones, or cut"
    kept += " the recording at a jump"
    wraps = "the position wraps 2 times by 6.28319 m or rad"
    spikes = "2 single positions lie far off the motion, the first at 0.700 s"
    for name, position, findings in (
        ("turning", turning, [f"{wraps}, and {spikes}{kept}"]),
        ("homed", homed, [f"the position jumps within one sample by 0.113 m or rad at 2.000 s{kept}"]),
        ("smooth", 0.05 * np.sin(3.0 * time), []),
    ):
        log = tmp_path / f"{name}.csv"
        np.savetxt(log, np.column_stack([time + 1.0, position]), delimiter=",", header="t,q", comments="", fmt="%.9g")
        converted = convert(log, ["time=t", "position=q"], str(tmp_path / name), ConvertOptions())
        assert list(converted.notices) == findings


@pytest.mark.parametrize("column", ["q", "u"])
def test_a_column_without_a_number_is_refused(
    tmp_path: Path, column: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A bag without one usable position was written with exit code 0."""
    monkeypatch.chdir(tmp_path)
    rows = {"q": "nan,1", "u": "1,nan"}[column]
    Path("allnan.csv").write_text("t,q,u\n" + "".join(f"{k}e-3,{rows}\n" for k in range(5)))
    arguments = ["convert", "allnan.csv", "--out", "bag", "--map", "time=t", "position=q", "control_effort=u"]
    assert main(arguments) == 1
    printed = capsys.readouterr()
    assert printed.err.startswith(f"allnan.csv: column {column} holds no number; check --map ") and not printed.out
    assert [path.name for path in tmp_path.iterdir()] == ["allnan.csv"]


def test_a_part_without_a_position_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("log.csv").write_text("t,q\n" + "".join(f"{k}e-3,{k if k < 10 else 'nan'}\n" for k in range(20)))
    convert_log = ["convert", "log.csv", "--map", "time=t", "position=q", "--out", "bag"]
    for options in (["--split", "0.6"], ["--from", "0.012"]):
        assert main([*convert_log, *options]) == 1
        assert "samples for one bag are all NaN or infinite; change --from" in capsys.readouterr().err
        assert [path.name for path in tmp_path.iterdir()] == ["log.csv"]


@pytest.mark.parametrize("switch", [[], ["--quiet"], ["--json"]])
def test_a_position_that_is_no_number_is_a_warning(
    tmp_path: Path, switch: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "log.csv"
    path.write_text("t,q\n5,1\n5.001,2\n5.002,nan\n5.003,3\n")
    assert main(["convert", str(path), "--map", "time=t", "position=q", "--out", str(tmp_path / "bag"), *switch]) == 0
    printed = capsys.readouterr()
    assert printed.err.startswith("Warning: 1 of 4 entries of position are NaN or infinite; ")
    assert "note: 1 of 4" not in printed.out


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_the_first_sample_has_its_reference(tmp_path: Path, storage: str) -> None:
    """It came behind position and effort, and every replay warned of it."""
    path = tmp_path / "log.csv"
    path.write_text("t,q,u,r\n" + "".join(f"{5 + 1e-3 * k:.3f},{k},1,{k}\n" for k in range(40)))
    columns = ["time=t", "position=q", "control_effort=u", "reference=r"]
    assert main(["convert", str(path), "--map", *columns, "--out", str(tmp_path / "bag"), "--storage", storage]) == 0
    samples = BagSamples(tmp_path / "bag", ["x"])
    blocks = [block for _, block in samples]
    assert samples.warnings == ()
    assert np.concatenate([block.reference_position for block in blocks]).tolist() == list(range(40))
