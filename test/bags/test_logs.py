"""Obstacles that real logs put in the way: each becomes numbers, or a sentence that says what to do."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sgms_observer.bags.conversion import choose_window, open_log, read_table, split_table
from sgms_observer.errors import RecordingError

ROWS = [[0.001 * k, 1e-6 * k * k, 0.5 - k] for k in range(30)]
MAP = {"time": "t", "position": "x", "control_effort": "u"}


def table_lines(separator: str, decimal: str = ".") -> list[str]:
    """Return the rows in a dialect."""
    return [separator.join(f"{number:.9g}".replace(".", decimal) for number in row) for row in ROWS]


def write(path: Path, lines: list[str], encoding: str = "utf-8") -> Path:
    """Write a log and return its path."""
    path.write_bytes("\r\n".join(lines).encode(encoding))
    return path


HEADS = {
    "instrument": ["Oscilloscope XY 3000", "Serial;00042;;", "Date;2026-11-22", "1000", "", "Channel setup:", "3;4"],
    "long": [f"# line {k} of a preamble" for k in range(700)],
    "numbers": ["1000", "2", "7"],
    "none": [],
}
UNITS = {
    "units": "s;m;N",
    "brackets": "[s];[mm];[Nm]",
    "types": "double;double;double",
    "words": "seconds;metres;newtons",
}


@pytest.mark.parametrize("head", HEADS)
@pytest.mark.parametrize("unit", ["", *UNITS])
def test_lines_above_the_table(tmp_path: Path, head: str, unit: str) -> None:
    lines = [*HEADS[head], "t;x;u", *([UNITS[unit]] if unit else []), *table_lines(";", ",")]
    log = read_table(write(tmp_path / "log.txt", lines), MAP)
    np.testing.assert_allclose(log.position, [row[1] for row in ROWS])
    assert log.control_effort is not None
    np.testing.assert_allclose(log.control_effort, [row[2] for row in ROWS])


def test_names_of_several_words_and_quotes(tmp_path: Path) -> None:
    lines = ["Time stamp   Actual position   Motor torque", *table_lines("   ")]
    assert open_log(write(tmp_path / "a.txt", lines)).names == ("Time stamp", "Actual position", "Motor torque")
    lines = ['"t","Position, actual","u"', *(",".join(f'"{n:.9g}"'.replace(".", ",") for n in row) for row in ROWS)]
    path = write(tmp_path / "b.csv", lines)
    log = read_table(path, {**MAP, "position": "Position, actual"})
    np.testing.assert_allclose(log.position, [row[1] for row in ROWS])


def test_columns_of_words_and_empty_fields(tmp_path: Path) -> None:
    lines = [
        "t;mode;x;u",
        *(f"{t:.9g};RUN;{x:.9g};{'' if k == 3 else '-' if k == 4 else u}" for k, (t, x, u) in enumerate(ROWS)),
    ]
    log = read_table(write(tmp_path / "log.csv", lines), MAP)
    assert log.control_effort is not None
    assert np.flatnonzero(np.isnan(log.control_effort)).tolist() == [3, 4]
    assert any("2 of 30 entries of control_effort" in notice for notice in log.notices)


def test_more_than_forty_columns(tmp_path: Path) -> None:
    wide = [[k * 0.01 if i == 0 else 100.0 * i + k for i in range(95)] for k in range(25)]
    path = write(tmp_path / "log.csv", [",".join(map(str, row)) for row in wide])
    log = read_table(path, {"time": "1", "position": "95-94", "control_effort": "50*2-3/2"})
    np.testing.assert_allclose(log.position, 100.0)
    np.testing.assert_allclose(log.control_effort, [2.0 * row[49] - row[2] / 2.0 for row in wide])
    with pytest.raises(RecordingError, match=r"has no column 96; it has 1, 2, .* and 55 more"):
        read_table(path, {"time": "1", "position": "96"})


@pytest.mark.parametrize(
    "stamps",
    [
        ["2026-11-22T23:59:59.9", "2026-11-23T00:00:00", "2026-11-23T00:00:00.100", "2026-11-23T00:00:00.2"],
        [
            "2026-11-22 23:59:59.9+01:00",
            "2026-11-23 00:00:00+01:00",
            "2026-11-22 23:00:00.1Z",
            "2026-11-22 23:00:00.2Z",
        ],
        ["23:59:59.9", "00:00:00.0", "00:00:00.1", "00:00:00.2"],
    ],
)
def test_dates_and_times_of_day(tmp_path: Path, stamps: list[str]) -> None:
    lines = ["t;x", *(f"{stamp};{k},5" for k, stamp in enumerate(stamps))]
    log = read_table(write(tmp_path / "log.csv", lines), {"time": "t", "position": "x"})
    np.testing.assert_allclose(np.diff(log.stamp_ns) * 1e-9, 0.1, atol=1e-9)
    assert log.position.tolist() == [0.5, 1.5, 2.5, 3.5]


def test_duplicate_stamps_are_dropped_and_counted(tmp_path: Path) -> None:
    rows = [(k, k) for k in range(10)] + [(9, 70), (9, 71), (10, 10), (12.5, 11)]
    path = write(tmp_path / "log.txt", ["ms\tdeg", *(f"{t}\t{x}" for t, x in rows)])
    log = read_table(path, {"time": "ms*0.001", "position": "deg*pi/180"})
    np.testing.assert_allclose(np.rad2deg(log.position), [*range(10), 10, 11])
    np.testing.assert_allclose((log.stamp_ns - log.stamp_ns[0]) * 1e-6, [*range(11), 12.5])  # irregular ones stay
    assert "2 of 14 samples repeat the stamp of the sample before; they were dropped" in log.notices


def test_a_log_without_times_takes_a_rate(tmp_path: Path) -> None:
    path = write(tmp_path / "log.txt", ["x", *(str(k) for k in range(20))])
    log = read_table(path, {"position": "x"}, rate=250.0)
    np.testing.assert_array_equal(log.stamp_ns, 1_000_000_000 + 4_000_000 * np.arange(20))
    with pytest.raises(RecordingError, match=r"--rate -1.0 Hz must be above 0"):
        read_table(path, {"position": "x"}, rate=-1.0)


@pytest.mark.parametrize("shape", [(6, 50), (50, 6)])
def test_series_of_matrices(tmp_path: Path, shape: tuple[int, int]) -> None:
    scipy_io = pytest.importorskip("scipy.io")
    series = np.arange(300.0).reshape(6, 50) + 1.0
    matrix = series if shape == (6, 50) else series.T
    path = tmp_path / "log.mat"
    scipy_io.savemat(path, {"rec": {"t": np.arange(50) * 0.01, "q": matrix}, "gear": [2.0, 4.0, 8.0]})
    log = read_table(
        path, {"time": "rec.t", "position": "rec.q[2]/gear[3]", "control_effort": "rec.q[6]-rec.q[1]*gear[1]"}
    )
    np.testing.assert_array_equal(log.position, series[1] / 8.0)
    np.testing.assert_array_equal(log.control_effort, series[5] - 2.0 * series[0])
    native = "rec.q(2,:)" if shape == (6, 50) else "rec.q(:,2)"
    np.testing.assert_array_equal(read_table(path, {"time": "rec.t", "position": native}).position, series[1])


def test_windows_and_halves(tmp_path: Path) -> None:
    log = read_table(write(tmp_path / "log.csv", ["t,x,u", *table_lines(",")]), MAP)
    window = choose_window(log, 0.005, 0.010)
    assert (window.stamp_ns - log.stamp_ns[0]).tolist() == [k * 1_000_000 for k in range(5, 10)]
    first, rest = split_table(log, 0.6)
    assert (first.stamp_ns.size, rest.stamp_ns.size) == (18, 12)
    np.testing.assert_array_equal(np.concatenate([first.position, rest.position]), log.position)
    for share in (0.0, 1.0, -1.0, 0.01, 0.999, float("nan")):
        with pytest.raises(RecordingError, match="--split"):
            split_table(log, share)
    for start, end in ((1.0, 2.0), (0.02, 0.01), (0.0, 0.0)):
        with pytest.raises(RecordingError, match="choose a window"):
            choose_window(log, start, end)
    for start, end in ((-5.0, 1.0), (0.0, float("nan"))):
        with pytest.raises(RecordingError, match="must not be negative"):
            choose_window(log, start, end)


def test_utf_16_of_windows_instruments(tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv", ["t\tx\tu", *table_lines("\t", ",")], "utf-16")
    np.testing.assert_allclose(read_table(path, MAP).position, [row[1] for row in ROWS])


def test_memory_is_a_few_times_that_of_the_columns(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    rows, columns = 40_000, 30
    line = ",".join(["{0:.4f}", *["{1:.6f}"] * (columns - 1)])
    path.write_text("\n".join(line.format(0.001 * k, float(k)) for k in range(rows)))
    tracemalloc.start()
    read_table(path, {"time": "1", "position": "2", "control_effort": "3-4"})
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert path.stat().st_size > 8_000_000
    assert peak < 30 * 8 * rows  # of a column's bytes, whatever else the file holds


WORDS = st.sampled_from(
    [*"tx012;,\t \n\"'#%-", "\n", "", "2.5", "-3e2", "0,5", "nan", "12:30:01", "2026-11-22T01:02:03", "[mm]", "\u00e4",
     "\x00", "\r", "1" * 400, "RUN", "2026-13-45", "99:99:99"]
)  # fmt: skip


@settings(max_examples=1500, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(WORDS, max_size=60).map("".join), st.sampled_from(["utf-8", "utf-16", "latin-1"]))
def test_any_text_gives_a_table_or_one_sentence(tmp_path: Path, text: str, encoding: str) -> None:
    path = tmp_path / "any.csv"
    path.write_bytes(text.encode(encoding))
    for columns in ({"time": "1", "position": "2"}, {"time": "t", "position": "x"}):
        try:
            log = read_table(path, columns)
        except RecordingError as error:
            assert "\n" not in str(error)
        else:
            assert np.all(np.diff(log.stamp_ns) > 0)


def _values(tmp_path: Path, lines: list[str]) -> list[list[float]]:
    """Return the columns of a log."""
    log = open_log(write(tmp_path / "log.csv", lines))
    columns = log.columns(tuple(log.names))
    return [columns[name].tolist() for name in log.names]


def test_points_between_thousands_beside_decimal_commas(tmp_path: Path) -> None:
    """2.543 counts were read as 2.543."""
    lines = ["t;counts;u", "0,001;-1;1.234,5", *(f"0,{k:03d};2.{k:03d};-0,5" for k in range(500, 540))]
    _, counts, effort = _values(tmp_path, lines)
    assert counts[:2] == [-1.0, 2500.0] and effort[:2] == [1234.5, -0.5]


def test_other_points_beside_decimal_commas_are_refused(tmp_path: Path) -> None:
    lines = ["t;x", *(f"0,{k:03d};{k}" for k in range(300)), "0,300;0.25"]
    with pytest.raises(RecordingError, match=r"column x: line 302 cannot be read, .*'0.25' .* beside decimal commas"):
        _values(tmp_path, lines)


def test_a_decimal_comma_after_many_whole_numbers(tmp_path: Path) -> None:
    lines = ["t;x", *(f"{k};0" for k in range(300)), "300;0,25", "301;-0,5"]
    assert _values(tmp_path, lines)[1][-2:] == [0.25, -0.5]


@pytest.mark.parametrize(
    "stamps",
    [
        ["22.11.2026 23:59:59,9", "23.11.2026 00:00:00,0", "23.11.2026 00:00:00,1"],
        ["11/22/2026 11:59:59.9 PM", "11/23/2026 12:00:00.0 AM", "11/23/2026 12:00:00.1 AM"],
    ],
)
def test_german_and_american_dates(tmp_path: Path, stamps: list[str]) -> None:
    np.testing.assert_allclose(
        _values(tmp_path, ["t;x", *(f"{one};1" for one in stamps)])[0], [0.0, 0.1, 0.2], atol=1e-9
    )


def test_exponents_of_fortran(tmp_path: Path) -> None:
    assert _values(tmp_path, ["t x", "0.0D+00 -1.5D-06", "1.0d-03 2.5D2"]) == [[0.0, 1e-3], [-1.5e-6, 250.0]]


@pytest.mark.parametrize("field", ["8,388,607", "0x7FFFFF", "00:01.234"])
def test_the_field_that_stops_the_reader_is_named(tmp_path: Path, field: str) -> None:
    lines = ["t;x", *(f"0.{k:03d};{field}" for k in range(30))]
    with pytest.raises(RecordingError, match=f"no table of numbers: in line 2 the field '{field}' is neither"):
        _values(tmp_path, lines)


def test_a_name_for_a_column_that_no_row_has(tmp_path: Path) -> None:
    """LabVIEW ends its line of names with a column of comments."""
    lines = ["X_Value\tpos\teff\tComment", *(f"0.{k}\t{k}\t-1" for k in range(10))]
    assert open_log(write(tmp_path / "log.lvm", lines)).names == ("X_Value", "pos", "eff")


def test_the_nearest_of_many_columns_come_first(tmp_path: Path) -> None:
    names = ["t", *(f"channel_{k}" for k in range(60)), "act_pos_deg"]
    lines = [",".join(names), *(",".join([str(k)] * len(names)) for k in range(3))]
    path = write(tmp_path / "log.csv", lines)
    with pytest.raises(RecordingError, match=r"no column act_pos; it has act_pos_deg, t, .* and 22 more"):
        read_table(path, {"time": "t", "position": "act_pos"})
    with pytest.raises(RecordingError, match="this table has names: give one of them"):
        read_table(path, {"time": "t", "position": "3"})
    with pytest.raises(RecordingError, match="a number cannot be added, only a column"):
        read_table(path, {"time": "t", "position": "channel_1+3"})
