"""info, init and check on recordings whose truth is known: one fault at a time, and all at once."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sgms_observer.application.axis_facts import count_reversals
from sgms_observer.bags.conversion import Table, write_table
from sgms_observer.bags.writer import BagWriter
from sgms_observer.cli.main import main
from sgms_observer.settings.load import load_settings

RATE = 500.0  # Hz
MASS, VISCOUS, COULOMB, OFFSET = 4.0, 12.0, 3.0, 0.8  # kg, N s/m, N, N
STEP = 2.0e-6  # m


def motion(duration: float = 12.0, stroke: float = 0.2) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return time, measured position and effort of a mass with friction."""
    time = np.arange(0.0, duration, 1.0 / RATE)
    angles = [(0.4, 2.0 * np.pi * 0.4), (0.1, 2.0 * np.pi * 1.7)]
    position, velocity, acceleration = np.zeros(len(time)), np.zeros(len(time)), np.zeros(len(time))
    for share, rate in angles:
        position += share * stroke * np.sin(rate * time)
        velocity += share * stroke * rate * np.cos(rate * time)
        acceleration -= share * stroke * rate**2 * np.sin(rate * time)
    effort = MASS * acceleration + VISCOUS * velocity + COULOMB * np.sign(velocity) + OFFSET
    effort += np.random.default_rng(1).normal(0.0, 0.05, len(time))
    return time + 1.0, STEP * np.round(position / STEP), effort


def write(path: Path, *, effort_factor: float = 1.0, axis: str = "x", keep: slice = slice(None), **more: float) -> str:
    """Write the motion as a bag and return its path."""
    time, position, effort = motion(**more)
    stamps = np.round(time * 1e9).astype(np.int64)[keep]
    write_table(Table(stamps, position[keep], effort_factor * effort[keep], None, None, ()), path, axis)
    return str(path)


def result(capsys: pytest.CaptureFixture[str], *arguments: str, code: int = 0) -> dict:
    """Run a command with ``--json`` and return its result."""
    assert main([*arguments, "--json"]) == code
    return json.loads(capsys.readouterr().out)


def test_info_says_what_is_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bag = write(tmp_path / "bag")
    info = result(capsys, "info", bag, "--joint-type", "prismatic")
    axis = info["axes"][0]
    assert info["inputs"] == {"position": "/position", "control_effort": "/control_effort", "reference": None}
    assert {topic["name"]: topic["messages"] for topic in info["topics"]} == {
        "/position": 6000,
        "/control_effort": 6000,
    }
    assert axis["rate_hz"] == pytest.approx(RATE, rel=1e-6)
    assert axis["position"]["step"] == pytest.approx(STEP, rel=1e-6)
    assert axis["gaps"] == axis["duplicate_stamps"] == 0
    assert axis["sign"] == "as the motion"
    for name, truth in (
        ("mass", MASS),
        ("viscous_coefficient", VISCOUS),
        ("coulomb_force", COULOMB),
        ("offset", OFFSET),
    ):
        found = axis["force_balance"][name]
        assert abs(found["value"] - truth) < 0.05 * truth + 3.0 * found["std_error"], name
    assert main(["info", bag]) == 0
    without_units = capsys.readouterr().out
    assert "usable for: identify, diagnose, replay" in without_units
    assert re.search(r", peak speed [\d.]+, \d+ reversals\n", without_units)
    assert re.search(r" mass [\d.]+ \+- [\d.]+, viscous_coefficient [\d.]+ \+- [\d.]+, coulomb_force", without_units)
    for joint_type, (mass, damping, effort) in (
        ("prismatic", ("kg", "N s/m", "N")),
        ("revolute", ("kg m^2", "N m s/rad", "N m")),
    ):
        assert main(["info", bag, "--joint-type", joint_type]) == 0
        balance = next(line for line in capsys.readouterr().out.splitlines() if "unexplained" in line)
        assert f" {mass}, viscous_coefficient " in balance and f" {damping}, coulomb_force " in balance
        assert re.search(rf"coulomb_force [\d.]+ \+- [\d.]+ {effort}; ", balance)


def test_info_says_why_a_bag_is_not_usable(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def reasons(bag: str) -> dict[str, str]:
        axis = result(capsys, "info", bag)["axes"][0]
        return {use["for"]: use["reason"] for use in axis["uses"] if not use["possible"]}

    assert "reversed relative to position" in reasons(write(tmp_path / "sign", effort_factor=-1.0))["identify"]
    assert "at least 200: record" in reasons(write(tmp_path / "short", keep=slice(0, 100)))["identify"]
    time, position, effort = motion()
    stamps = np.round(time * 1e9).astype(np.int64)
    write_table(Table(stamps, 0.1 * time, effort, None, None, ()), tmp_path / "one_way", "x")
    assert "reverses 0 times" in reasons(str(tmp_path / "one_way"))["identify"]
    write_table(Table(stamps, position, None, None, None, ()), tmp_path / "position", "x")
    assert set(reasons(str(tmp_path / "position"))) == {"identify", "diagnose", "replay"}
    write_table(Table(stamps, np.zeros(len(stamps)), effort, None, None, ()), tmp_path / "rest", "x")
    assert "never changes" in reasons(str(tmp_path / "rest"))["identify"]
    coarse = 0.01 * np.round(position / 0.01)
    write_table(Table(stamps, coarse, effort, None, None, ()), tmp_path / "coarse", "x")
    assert "steps of the encoder" in reasons(str(tmp_path / "coarse"))["identify"]


def test_gaps_duplicates_and_missing_efforts_are_counted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    time, position, effort = motion()
    stamps = np.round(time * 1e9).astype(np.int64)
    stamps[3000:] += 100_000_000
    stamps[10] = stamps[9]
    with BagWriter(tmp_path / "bag") as bag:
        bag.write_joint_states("position", stamps, ("x",), position=position)
        bag.write_joint_states("control_effort", stamps[::2], ("x",), effort=effort[::2])
    axis = result(capsys, "info", str(tmp_path / "bag"))["axes"][0]
    assert (axis["gaps"], axis["duplicate_stamps"], axis["backward_stamps"]) == (2, 1, 0)
    assert axis["longest_gap_s"] == pytest.approx(0.102)
    assert axis["effort"]["missing_share"] == pytest.approx(0.5, abs=0.01)
    assert any("have no effort" in doubt for doubt in axis["doubts"])


def test_topics_of_other_names_and_their_remedy(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    time, position, effort = motion()
    stamps = np.round(time * 1e9).astype(np.int64)
    with BagWriter(tmp_path / "bag") as bag:
        bag.write_joint_states("/stage1/position/raw", stamps, ("x",), position=position)
        bag.write_joint_states("/stage1/force", stamps, ("x",), effort=effort)
    yaml = str(tmp_path / "start.yaml")
    assert main(["init", str(tmp_path / "bag"), "--out", yaml]) == 1
    error = capsys.readouterr().err
    assert "has no topic position; it holds /stage1/force, /stage1/position/raw" in error
    assert "--topic position=/stage1/position/raw" in error
    assert not Path(yaml).exists()
    named = ["--topic", "position=/stage1/position/raw", "--topic", "control_effort=/stage1/force"]
    assert result(capsys, "init", str(tmp_path / "bag"), "--out", yaml, *named)["axes"][0]["name"] == "x"
    assert result(capsys, "check", yaml, str(tmp_path / "bag"), *named)["fits"]
    faults = result(capsys, "check", yaml, str(tmp_path / "bag"), code=1)["faults"]
    assert len(faults) == 2 and all("--topic" in fault for fault in faults)
    assert "if one of them is the control_effort, name it with --topic control_effort=TOPIC" in faults[1]
    info = result(capsys, "info", str(tmp_path / "bag"))
    assert info["axes"] == [] and "--topic position=" in info["warnings"][0]
    for wrong, sentence in (
        ("position", "must read KEY=NAME"),
        ("force=x", "none of position"),
        ("position=/none", "no topic /none"),
    ):
        assert main(["check", yaml, str(tmp_path / "bag"), "--topic", wrong]) == 1
        assert sentence in capsys.readouterr().err


@pytest.mark.parametrize("joint_type", ["prismatic", "revolute"])
def test_a_template_is_commented_and_loads(joint_type: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    yaml = tmp_path / "start.yaml"
    arguments = ["init", "--out", str(yaml), "--joint-type", joint_type, "--axis", "a", "--axis", "y"]
    assert main(arguments) == 0
    text = yaml.read_text()
    assert [axis.name for axis in load_settings(yaml).axes] == ["a", "y"]
    assert ("N m/rad" in text) == (joint_type == "revolute")
    numbers = [line for line in text.splitlines() if ": " in line.split("#")[0]]
    assert sum("#" in line for line in numbers) > 0.9 * len(numbers)
    capsys.readouterr()
    assert main(arguments) == 1
    assert "exists already" in capsys.readouterr().err and yaml.read_text() == text
    assert main([*arguments, "--overwrite", "--quiet"]) == 0
    assert capsys.readouterr().out == ""


def test_a_bag_gives_a_file_that_simulates_and_fits(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bag, yaml = write(tmp_path / "bag"), str(tmp_path / "start.yaml")
    made = result(capsys, "init", bag, "--out", yaml)["axes"][0]
    assert made["mass"] == pytest.approx(MASS, rel=0.05)
    assert made["effects"]["offset"]["force"] == pytest.approx(OFFSET, rel=0.2)
    assert result(capsys, "check", yaml, bag) == {
        "schema": 1,
        "fits": True,
        "axes": ["x"],
        "faults": [],
        "warnings": [],
    }


def test_check_tells_all_faults_at_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bag, yaml = write(tmp_path / "bag"), tmp_path / "start.yaml"
    assert main(["init", bag, "--out", str(yaml), "--quiet"]) == 0
    lines = [
        line.replace("effort_scale: 1.0", "effort_scale: -1.0")
        .replace("sample_period: 0.002", "sample_period: 0.001")
        .replace("names: [offset]", "names: [offset, cogging]")
        .replace("        offset: {", "        cogging: {amplitude: 1.0, pitch: 0.5}\n        offset: {")
        for line in yaml.read_text().splitlines()
    ]
    lines = ["          resolution: 1.0e-4" if line.startswith("          resolution:") else line for line in lines]
    lines = ["          amplitude: 200.0" if line.startswith("          amplitude:") else line for line in lines]
    lines = [
        "        element_stiffness: [1.0, 1.0, 1.0, 1.0]" if "element_stiffness" in line else line for line in lines
    ]
    yaml.write_text("\n".join(lines))
    capsys.readouterr()
    faults = result(capsys, "check", str(yaml), bag, code=1)["faults"]
    wanted = ["sample_period = 0.001 s", "effort_scale = -1 has the wrong sign", "cogging.pitch", "encoder.resolution",
              "stage.reference spans", "element_stiffness lets"]  # fmt: skip
    for text in wanted:
        assert sum(text in fault for fault in faults) == 1, text
    assert len(faults) == len(wanted)
    assert all("\n" not in fault and ";" in fault for fault in faults)
    assert main(["check", str(yaml), bag]) == 1
    assert capsys.readouterr().err.splitlines()[: len(faults)] == faults


def test_check_tells_scales_and_names(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bag, yaml = write(tmp_path / "bag"), tmp_path / "start.yaml"
    assert main(["init", bag, "--out", str(yaml), "--quiet"]) == 0
    start = yaml.read_text()
    yaml.write_text(start.replace("position_scale: 1.0", "position_scale: 0.001"))
    assert any("x.mass" in fault for fault in result(capsys, "check", str(yaml), bag, code=1)["faults"])
    yaml.write_text(start.replace("position_scale: 1.0", "position_scale: 1000.0"))
    assert any("in millimetres" in fault for fault in result(capsys, "check", str(yaml), bag, code=1)["faults"])
    yaml.write_text(start.replace('"x"', '"q"'))
    assert "holds x, not q" in result(capsys, "check", str(yaml), bag, code=1)["faults"][0]
    yaml.write_text(start.replace("mass:", "mas:").replace("gain: 0.9", "gain: 9.0"))
    assert len(result(capsys, "check", str(yaml), code=1)["faults"]) == 2
    yaml.write_text(start)
    assert result(capsys, "check", str(yaml))["fits"]
    assert "--axis q is not in" in result(capsys, "check", str(yaml), "--axis", "q", code=1)["faults"][0]


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_any_recording_gives_facts_or_one_sentence(tmp_path: Path, data: st.DataObject) -> None:
    """Whatever numbers a bag holds, info and init end without a fault of their own, and what init writes loads."""
    folder = tmp_path / str(len(list(tmp_path.iterdir())))
    count = data.draw(st.sampled_from([1, 2, 5, 199, 200, 400]))
    step = data.draw(st.sampled_from([1, 1_000, 1_000_000, 50_000_000]))
    wild = st.sampled_from([0.0, 1.0, -1.0, 1e-300, 1e12, -1e12, float("nan"), float("inf")])
    seed = data.draw(st.integers(0, 2**32 - 1))
    chance = np.random.default_rng(seed)
    columns = []
    for _ in range(2):
        kind = data.draw(st.sampled_from(["constant", "noise", "steps", "wild", "ramp"]))
        columns.append({
            "constant": lambda: np.full(count, data.draw(wild)),
            "noise": lambda: chance.normal(size=count) * 10.0 ** data.draw(st.integers(-12, 12)),
            "steps": lambda: chance.integers(-3, 3, count).astype(float),
            "wild": lambda: chance.choice([0.0, 1e300, -1e300, np.nan, np.inf, 1.0], count),
            "ramp": lambda: np.linspace(0.0, 1.0, count),
        }[kind]())  # fmt: skip
    stamps = 1_000_000_000 + np.cumsum(chance.integers(0, 3, count)) * step
    with BagWriter(folder / "bag") as bag:
        bag.write_joint_states("position", stamps, ("x",), position=columns[0])
        bag.write_joint_states("control_effort", stamps, ("x",), effort=columns[1])
    yaml = folder / "start.yaml"
    assert main(["info", str(folder / "bag"), "--quiet"]) in (0, 1)
    code = main(["init", str(folder / "bag"), "--out", str(yaml), "--quiet"])
    assert code in (0, 1)
    if code == 0:
        load_settings(yaml)
        assert main(["check", str(yaml), str(folder / "bag"), "--quiet"]) in (0, 1)


@given(st.integers(0, 40), st.floats(0.0, 0.04))
def test_reversals_are_counted_through_noise(count: int, noise: float) -> None:
    turns = np.concatenate([np.linspace(k % 2, (k + 1) % 2, 50) for k in range(count + 1)])
    shaken = turns + np.random.default_rng(count).uniform(-noise, noise, len(turns))
    assert count_reversals(shaken, 0.1) == count


@pytest.mark.parametrize(("gather_time", "is_late"), [("0.0", False), ("5.0e-4", False), ("2.0e-3", True)])
def test_samples_that_wait_longer_than_the_compensation_looks_ahead(
    gather_time: str, is_late: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "axis.yaml").write_text(
        "/**:\n  ros__parameters:\n    axes: [x]\n    sample_period: 1.0e-4\n"
        f"    gather_time: {gather_time}\n    x: {{mass: 3.0, compensation: {{look_ahead: 1.0e-3}}}}\n"
    )
    found = result(capsys, "check", str(tmp_path / "axis.yaml"))
    assert found["fits"] and len(found["warnings"]) == is_late
    assert all("the first compensations of every block come too late" in one for one in found["warnings"])


def write_turning(path: Path, *, jump: float = 0.0) -> str:
    """Write the motion of a joint that turns by some turns as a drive logs it, 0 to 2 pi, and return the bag's path."""
    time, position, effort = motion(stroke=20.0)
    position = np.mod(position, 2.0 * np.pi) if not jump else position + jump * (time > 7.0)
    write_table(Table(np.round(time * 1e9).astype(np.int64), position, effort, None, None, ()), path, "x")
    return str(path)


def test_an_angle_that_wraps_is_read_as_the_motion(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It was read as 700 rad/s, with a mass of nothing, and diagnose named an effect."""
    bag, out = write_turning(tmp_path / "bag"), str(tmp_path / "axis.yaml")
    (axis,) = result(capsys, "info", bag, "--joint-type", "revolute")["axes"]
    assert axis["position"]["peak_speed"] < 50.0 and axis["force_balance"]["mass"]["value"] == pytest.approx(MASS, 0.05)
    assert "by 6.28319 rad; it was unwrapped" in axis["notes"][0]
    initialised = result(capsys, "init", bag, "--out", out, "--joint-type", "revolute")
    assert "it was unwrapped" in "".join(initialised["warnings"])
    (drafted,) = load_settings(out).axes
    assert drafted.mass == pytest.approx(MASS, 0.05) and drafted.filter.jump_speed < 500.0  # a wrap is 3142 rad/s
    assert "it was unwrapped" in "".join(result(capsys, "check", out, bag)["warnings"])


def test_a_homing_within_a_recording_is_reported_by_every_command(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bag, out = write_turning(tmp_path / "bag", jump=30.0), str(tmp_path / "axis.yaml")
    (axis,) = result(capsys, "info", bag)["axes"]
    sentence = "the position jumps within one sample by 30 {} at 6.002 s; the recording is cut there"
    assert sentence.format("m or rad") in axis["notes"][0] and axis["pieces"] == 2
    warnings = result(capsys, "init", bag, "--out", out, "--joint-type", "revolute")["warnings"]
    assert sentence.format("rad") in "".join(warnings)
    assert sentence.format("rad") in "".join(result(capsys, "check", out, bag)["warnings"])
    (drafted,) = load_settings(out).axes
    assert drafted.filter.jump_speed < 1000.0  # the jump is 15,000 rad/s


def write_topics(
    path: Path, *, late_ns: int = 0, joint: str = "x", every: int = 1, effort_is_known: bool = True
) -> str:
    """Write the motion with topics that do not agree, and return the bag's path.

    Args:
        path: of the bag.
        late_ns: by how much efforts are stamped later than positions [ns].
        joint: name of the joint in the topic of the efforts.
        every: positions per effort.
        effort_is_known: whether efforts are numbers.
    """
    time, position, effort = motion()
    stamps = np.round(time * 1e9).astype(np.int64)
    with BagWriter(path) as bag:
        bag.write_joint_states("position", stamps, ("x",), position=position)
        values = effort[::every] if effort_is_known else np.full(len(effort[::every]), np.nan)
        bag.write_joint_states("control_effort", stamps[::every] + late_ns, (joint,), effort=values)
    return str(path)


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ({"late_ns": 600_000}, "/control_effort is stamped 0.6 ms after the position, more than a quarter"),
        ({"late_ns": -600_000}, "/control_effort is stamped 0.6 ms before the position, more than a quarter"),
        ({"joint": "motor"}, "/control_effort holds motor, not x: give the joint one name in both topics"),
        ({"effort_is_known": False}, "/control_effort holds no number as the effort of x: record the effort"),
    ],
)
def test_why_no_effort_belongs_to_a_position(
    wrong: dict[str, object], sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bag = write_topics(tmp_path / "bag", **wrong)
    right, out = write(tmp_path / "right"), str(tmp_path / "axis.yaml")
    (axis,) = result(capsys, "info", bag)["axes"]
    assert {use["for"] for use in axis["uses"] if use["reason"].startswith(sentence)} == {
        "identify", "diagnose", "replay",
    }  # fmt: skip
    result(capsys, "init", right, "--out", out)
    (fault,) = result(capsys, "check", out, bag, code=1)["faults"]
    assert fault.startswith(f"x: {sentence}")


def test_efforts_at_a_lower_rate_leave_the_sample_period_as_it_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It was that of the efforts, and check asked for it; then no sample of the observer was corrected, with code 0."""
    bag, out = write_topics(tmp_path / "bag", every=4), str(tmp_path / "axis.yaml")
    (axis,) = result(capsys, "info", bag)["axes"]
    assert axis["rate_hz"] == pytest.approx(RATE)
    reasons = {use["for"]: use["reason"] for use in axis["uses"] if not use["possible"]}
    assert reasons == {
        "replay": "control_effort comes at 125 Hz and position at 500 Hz, so the observer makes no correction: record"
        " both at one rate"
    }
    assert main(["info", bag]) == 0 and "at 500 Hz (with an effort 125 Hz)" in capsys.readouterr().out
    assert result(capsys, "init", bag, "--out", out)["sample_period"] == pytest.approx(1.0 / RATE)
    assert result(capsys, "check", out, bag)["fits"]
    assert main(["replay", bag, "--config", out, "--out", str(tmp_path / "replayed"), "--json"]) == 3
    printed = capsys.readouterr()
    assert "Warning: x: the observer made no correction, because no window of its filter has a" in printed.err
    figures = json.loads(printed.out)["axes"]["x"]
    assert figures["corrections"] == 0 and figures["innovation"] is None and figures["nis"] is None
    page = (tmp_path / "replayed" / "report.html").read_text(encoding="utf-8")
    assert "made no correction, so the recording does not show whether it fits" in page
    assert main(["replay", bag, "--config", out, "--out", str(tmp_path / "again")]) == 3
    assert "0 corrections;" in capsys.readouterr().out


def test_init_of_a_bag_without_a_position_names_no_axis(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The sentence was about ``--axis x``, which was not given, and said that the bag has x."""
    stamps = 10**9 + 1_000_000 * np.arange(50)
    bag, yaml = str(tmp_path / "allnan"), tmp_path / "start.yaml"
    write_table(Table(stamps, np.full(50, np.nan), np.zeros(50), None, None, ()), bag, "x")
    assert main(["init", bag, "--out", str(yaml)]) == 1
    assert capsys.readouterr().err == f"/position of {bag} holds no position of any joint; record it again\n"
    assert not yaml.exists()


@pytest.mark.parametrize("key", ["position", "control_effort", "reference"])
@pytest.mark.parametrize("command", ["info", "init", "replay", "identify", "diagnose"])
def test_a_named_topic_that_is_not_there_is_refused(
    tmp_path: Path, command: str, key: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """``info`` ended with 0: a warning for the position, and for the effort "no sample has an effort"."""
    bag, config = str(tmp_path / "bag"), tmp_path / "axis.yaml"
    stamps = 10**9 + 1_000_000 * np.arange(50)
    write_table(Table(stamps, np.arange(50.0), np.zeros(50), None, None, ()), bag, "x")
    config.write_text("/**: {ros__parameters: {sample_period: 0.001, axes: [x], x: {mass: 1.0}}}\n")
    out = {"info": [], "init": ["--out", str(tmp_path / "start.yaml")]}.get(
        command, ["--config", str(config), "--out", str(tmp_path / "out.yaml")]
    )
    assert main([command, bag, "--topic", f"{key}=/nothere", *out]) == 1
    printed = capsys.readouterr()
    assert printed.err.startswith(f"{bag} has no topic /nothere; it holds /control_effort, /position; ")
    assert printed.err.count("\n") == 1 and not printed.out


def test_check_lists_a_named_topic_that_is_not_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bag, config = str(tmp_path / "bag"), tmp_path / "axis.yaml"
    write_table(Table(10**9 + 1_000_000 * np.arange(50), np.arange(50.0), np.zeros(50), None, None, ()), bag, "x")
    config.write_text("/**: {ros__parameters: {sample_period: 0.001, axes: [x], x: {mass: 1.0}}}\n")
    assert main(["check", str(config), bag, "--topic", "reference=/nothere"]) == 1
    assert capsys.readouterr().err.count(f"{bag} has no topic /nothere; it holds /control_effort, /position; ") == 1


def test_positions_and_efforts_that_are_no_numbers_are_counted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Ten missing positions were "0 gaps", and efforts of NaN had "no effort with the same stamp"."""
    bag = str(tmp_path / "bag")
    position, effort = np.sin(0.05 * np.arange(2000.0)), np.cos(0.05 * np.arange(2000.0))
    position[500:510], effort[900:1000] = np.nan, np.inf
    write_table(Table(10**9 + 1_000_000 * np.arange(2000), position, effort, None, None, ()), bag, "x")
    main(["info", bag])
    printed = capsys.readouterr().err
    assert "x: 10 messages have no number as the position and are left out" in printed
    assert "x: 5.03 % of the samples have no effort: no message with the same stamp, or no number in it" in printed
