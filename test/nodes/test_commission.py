"""``sgms commission`` on the real graph, with the stage node as the table: the whole way, and every way to stop it."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import Browser
from looks import check_report
from program import PATIENCE
from ros_fixtures import Start
from ros_graph import Graph, NodeProcess, decode_joint_state, wait_until
from start_file import WINDOW, start_file

from sgms_observer.application.commission.learn import diagnose, excite, load_motion
from sgms_observer.application.commission.ledger import (
    DONE,
    EXCITATION,
    FAILED,
    LEARN_BAG,
    OWN_BAG,
    OWN_MOTION,
    SKIPPED,
    Ledger,
)
from sgms_observer.application.commission.motion import Motion, motion_from_rows, representative_motion
from sgms_observer.application.commission.session import Plan, Request, Session
from sgms_observer.application.commission.table import HeldUp
from sgms_observer.application.simulate import Simulation, simulate
from sgms_observer.bags.cdr import JointStateEncoder
from sgms_observer.nodes.axis_listener import EFFORT, POSITION, AxisListener
from sgms_observer.settings.axis import AxisSettings
from sgms_observer.settings.load import load_settings

ROOT = Path(__file__).resolve().parents[2]
COMMAND = "/axis/command"
START = start_file(
    WINDOW, "estimator: {kind: mhe, correction_every: 2, parameters: [kappa]}", "compensation: {limit: 10.0}"
)
HIDDEN = "effects: {names: [cogging], cogging: {amplitude: 1.4, pitch: 2.0e-3, phase: 0.3}}"
TWO_HIDDEN = HIDDEN.replace("[cogging]", "[cogging, offset]").replace("}}", "}, offset: {force: 0.8}}")
"""Cogging and a constant force."""
ASYMMETRIC = "effects: {names: [asymmetric_coulomb], asymmetric_coulomb: {share: 0.05}}"
"""Friction that depends on the direction: an offset wherever the sliding force is constant."""
STAGE = """      stage:
        reference: {kind: topic}
        encoder: {resolution: 1.0e-9, noise: 2.0e-9}
        force_noise: 0.02
"""


def table(*stage: str, axis: str = "") -> str:
    """Return the parameter file of a table; further lines of its stage and of its axis."""
    own = f"      {axis}\n" if axis else ""
    return START + own + STAGE + "".join(f"        {line}\n" for line in stage)


class Commission:
    """The command as a process.

    Args:
        folder: where it runs; it writes into ``out`` there.
        options: further options.
    """

    def __init__(self, folder: Path, *options: str) -> None:
        (folder / "start.yaml").write_text(START)
        self.out = folder / "out"
        self.process = subprocess.Popen(
            [sys.executable, "-m", "sgms_observer", "commission", "--yes", "--config", "start.yaml", "--out", "out",
             *options],
            cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
            env={**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), *sys.path])},
        )  # fmt: skip

    def end(self, patience: float = 5 * PATIENCE) -> tuple[int, str]:
        """Return the exit code and what was said."""
        said, _ = self.process.communicate(timeout=patience)
        return self.process.returncode, said

    def stop(self) -> None:
        """End it, if it runs."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
            try:
                self.process.communicate(timeout=PATIENCE)
            except subprocess.TimeoutExpired:
                self.process.kill()

    def result(self) -> dict[str, Any]:
        """Return commission.json."""
        return json.loads((self.out / "commission.json").read_text())


@pytest.fixture
def commission(tmp_path: Path) -> Any:
    """Return a function that starts the command; it is ended after the test."""
    started: list[Commission] = []

    def begin(*options: str) -> Commission:
        started.append(Commission(tmp_path, *options))
        return started[-1]

    yield begin
    for one in started:
        one.stop()


def prepare(folder: Path, own: Motion | None = None) -> Ledger:
    """Prepare a commissioning whose table was checked, by its own words; return its ledger.

    Args:
        folder: where the command runs.
        own: the user's own motion; the one that stands for it if None.
    """
    (folder / "start.yaml").write_text(START)
    out = folder / "out"
    request = Request(str(folder / "start.yaml"), out)
    plan = Plan.of(request)
    out.mkdir()
    own = own or representative_motion(plan.limits, plan.settings.sample_period)
    own.write(out / OWN_MOTION)
    ledger = Ledger(out, request.as_json())
    ledger.facts = {"origin": 0.0, "delay": 0.0, "lead": 0.2, "baseline": {"rms": 3.7e-6, "peak": 5.1e-6}}
    finish(ledger, "check")
    return ledger


def finish(ledger: Ledger, *steps: str) -> None:
    """Note that steps are done."""
    for name in steps:
        ledger.note(name, DONE, 1.0, "prepared by the test", ["commission.json"])


def learnt_before(folder: Path, own: Motion | None = None) -> None:
    """Prepare a commissioning that has learnt its model, so that it compensates next; arguments as of ``prepare``."""
    ledger = prepare(folder, own)
    model = START.replace("compensation: {limit: 10.0}", "compensation: {limit: 10.0, look_ahead: 2.0e-3}")
    (ledger.folder / "candidate.yaml").write_text(model + f"      {HIDDEN}\n")
    finish(ledger, "excite", "record", "identify", "diagnose", "next_experiment", "observe")


def ambiguous_before(folder: Path) -> None:
    """Prepare a commissioning with simulated recordings.

    Its diagnosis names the true effect; the other one is written as its alternative.
    """
    ledger = prepare(folder)
    unused: Any = None
    plan = Plan.of(Request(str(folder / "start.yaml"), ledger.folder))
    session = Session(plan, ledger, unused, unused, lambda _: None, lambda _title, _share: None)
    excite(session)
    for seed, bag, motion in ((1, LEARN_BAG, EXCITATION), (2, OWN_BAG, OWN_MOTION)):
        played = f"reference: {{kind: file, file: {session.path(motion)}}}"
        (folder / "played.yaml").write_text(table(axis=ASYMMETRIC).replace("reference: {kind: topic}", played))
        stage = Simulation(load_settings(folder / "played.yaml"), load_motion(session, motion).duration, seed, False)
        simulate(stage, str(session.path(bag)), "mcap", True, lambda _: None)
    diagnose(session)
    (named,) = ledger.effects
    assert (named["name"], named["alternatives"]) == ("asymmetric_coulomb", [])
    named["alternatives"] = ["offset"]
    finish(ledger, "excite", "record", "identify", "diagnose")


def compensation(graph: Graph, newest: int) -> np.ndarray:
    """Return the newest compensations heard [N]."""
    heard = graph.messages["friction_compensation"][-newest:]
    return np.array([decode_joint_state(message)[4][0] for message in heard])


def compensating(graph: Graph, run: Commission) -> None:
    """Wait until a compensation acts, from now on."""
    graph.messages["friction_compensation"].clear()

    def acts() -> bool:
        assert run.process.poll() is None, run.end()
        return bool(np.any(np.abs(compensation(graph, 100)) > 0.5))

    wait_until(acts, "a compensation that acts", 2 * PATIENCE)


def has_let_go(graph: Graph) -> None:
    """Check that no force is left, and that the set-point came to rest softly."""
    assert compensation(graph, 1)[-1] == 0.0
    velocities = np.array([decode_joint_state(message)[3][0] for message in graph.messages["reference"]])
    assert velocities[-1] == 0.0


def is_at_rest_without_force(graph: Graph, reference: str = "reference") -> None:
    """Check that the set-point came to rest, and that no force was ever sent."""
    assert decode_joint_state(graph.messages[reference][-1])[3][0] == 0.0
    assert not graph.messages["friction_compensation"]


def stopped(run: Commission, step: str, *words: str) -> None:
    """Check that folder and page tell which step failed and why, and that the folder can be resumed."""
    result = run.result()
    (failed,) = [one for one in result["steps"] if one["state"] == FAILED]
    assert failed["name"] == step and all(word in failed["sentence"] for word in words), failed
    behind = result["steps"][result["steps"].index(failed) + 1 :]
    assert {one["state"] for one in behind[:-1]} <= {SKIPPED} and behind[-1]["name"] == "report"
    assert result["usable"] is False and result["reason"] == f"step {step} failed: {failed['sentence']}"
    assert f"step {step} failed" in (run.out / "report.html").read_text()


def test_the_whole_way(start: Start, commission: Any, browser: Browser) -> None:
    """Both hidden effects are named, and the tracking error falls at least five times with no peak larger."""
    start("stage_node", table(axis=TWO_HIDDEN))
    run = commission("--time", "1500")
    code, said = run.end(15 * PATIENCE)
    assert code == 0, said
    result = run.result()
    assert [one["state"] for one in result["steps"]] == ["done"] * 10, said
    assert sorted(effect["name"] for effect in result["effects"]) == ["cogging", "offset"]
    assert not any(effect["alternatives"] for effect in result["effects"])
    found = {effect["name"]: effect["parameters"] for effect in result["effects"]}
    assert found["cogging"]["pitch"] == pytest.approx(2.0e-3, rel=2e-3)
    assert found["offset"]["force"] == pytest.approx(0.8, rel=0.1)
    tracking = result["tracking"]
    assert tracking["unit"] == "m"
    assert tracking["rms_after"] * 5.0 < tracking["rms_before"]
    assert tracking["peak_after"] <= tracking["peak_before"]
    assert result["usable"] is True and (run.out / result["yaml"]).exists()
    check_report(browser, run.out / "report.html", 2)
    page = (run.out / "report.html").read_text()
    assert page.index("<h2>Tracking before and after") < page.index("<h2>What was found")
    assert re.search(r"amplitude 1\.\d+ \+- [\d.]+ N, pitch (2\.00|1\.99)\d+ \+- [\d.]+ mm", page)
    again = commission("--time", "1500")
    code, said = again.end()
    assert code == 0 and said.count("done before") == 10, said
    assert [one["state"] for one in again.result()["steps"]] == ["skipped"] * 10


def test_the_experiment_for_what_is_ambiguous(start: Start, graph: Graph, commission: Any, tmp_path: Path) -> None:
    """Ctrl-C in the experiment for two ambiguous effects; the rerun plays it and names the true one.

    In so little noise the first recording tells the pair apart, so that the test writes the alternative itself, and
    what scatters from run to run decides nothing. ``test_separating_experiment.py`` has a first recording that leaves
    the pair ambiguous by itself.
    """
    start("stage_node", table(axis=ASYMMETRIC))
    graph.listen("friction_compensation", "reference")
    ambiguous_before(tmp_path)
    run = commission("--time", "1500")
    designed = run.out / "experiment_1.csv"

    sent: list[int] = []

    def plays() -> bool:
        assert run.process.poll() is None, run.end()
        sent.append(len(graph.messages["reference"]) if designed.exists() else 0)
        return sent[-1] > 4000 + next((count for count in sent if count), sent[-1])

    wait_until(plays, "the experiment", 10 * PATIENCE)
    run.process.send_signal(signal.SIGINT)
    code, said = run.end()
    assert code == 130, said
    stopped(run, "next_experiment", "interrupted by the user")
    assert run.result()["effects"][0]["alternatives"] == ["offset"]
    velocities = np.array([decode_joint_state(message)[3][0] for message in graph.messages["reference"]])
    assert velocities[-1] == 0.0 and np.max(np.abs(np.diff(velocities[-200:]))) <= 1.0 * 1e-3 * 1.02
    assert not graph.messages["friction_compensation"]  # no observer ran: no force was ever sent
    again = commission("--time", "1500")

    def separated() -> str:
        assert again.process.poll() is None, again.end()
        step = next((one for one in again.result()["steps"] if one["name"] == "next_experiment"), None)
        return str(step["sentence"]) if step and step["state"] == DONE else ""

    sentence = wait_until(separated, "the experiment and its diagnosis", 10 * PATIENCE)
    assert sentence.startswith("experiment 1 for ")
    assert (again.out / "diagnosis_1" / "augmented.yaml").exists()
    (found,) = again.result()["effects"]
    assert (found["name"], found["alternatives"]) == ("asymmetric_coulomb", [])


def test_ctrl_c_leaves_no_force_and_is_resumed(start: Start, graph: Graph, commission: Any, tmp_path: Path) -> None:
    """The own motion is short, because the rerun plays it to the end with each gain, and before and after."""
    start("stage_node", table(HIDDEN))
    seconds = np.linspace(0.0, 2.0, 2001)
    learnt_before(tmp_path, motion_from_rows(seconds, 4.0e-3 * np.sin(0.5 * np.pi * seconds) ** 2, 1.0e-3))
    graph.listen("friction_compensation", "reference")
    run = commission()
    compensating(graph, run)
    run.process.send_signal(signal.SIGINT)
    code, said = run.end()
    assert code == 130, said
    stopped(run, "compensate", "interrupted by the user")
    has_let_go(graph)
    velocities = np.array([decode_joint_state(message)[3][0] for message in graph.messages["reference"]])
    assert np.max(np.abs(np.diff(velocities[-200:]))) <= 1.0 * 1e-3 * 1.02
    again = commission()
    compensating(graph, again)
    code, said = again.end()
    assert code in (0, 3), said
    assert again.result()["steps"][-1]["name"] == "report"


def test_a_lost_topic_leaves_no_force_and_is_resumed(
    start: Start, graph: Graph, commission: Any, tmp_path: Path
) -> None:
    stage: NodeProcess = start("stage_node", table(HIDDEN))
    learnt_before(tmp_path)
    graph.listen("friction_compensation", "reference")
    run = commission()
    compensating(graph, run)
    stage.process.kill()
    code, said = run.end()
    assert code == 1, said
    stopped(run, "compensate", "stopped arriving")
    has_let_go(graph)
    start("stage_node", table(HIDDEN))
    compensating(graph, commission())


def test_a_stamp_that_stands_still_leaves_no_force(start: Start, graph: Graph, commission: Any, tmp_path: Path) -> None:
    """The drive hangs, and its node goes on to publish the last sample."""
    stage: NodeProcess = start("stage_node", table(HIDDEN))
    learnt_before(tmp_path)
    graph.listen("friction_compensation", "reference", "position", "control_effort")
    run = commission()
    compensating(graph, run)
    publish = {topic: graph.publisher(topic) for topic in ("position", "control_effort")}
    stage.process.kill()
    last = {topic: graph.messages[topic][-1] for topic in publish}
    end = time.monotonic() + PATIENCE
    while run.process.poll() is None and time.monotonic() < end:
        for topic, message in last.items():
            publish[topic](message)
        time.sleep(1e-3)
    code, said = run.end()
    assert code == 1, said
    stopped(run, "compensate", "without a new stamp")
    has_let_go(graph)


def test_a_limit_leaves_no_force(start: Start, graph: Graph, commission: Any, tmp_path: Path) -> None:
    """Somebody else sends the axis out of its stroke."""
    start("stage_node", table(HIDDEN))
    learnt_before(tmp_path)
    graph.listen("friction_compensation", "reference")
    run = commission()
    compensating(graph, run)
    publish, encode = graph.publisher("reference"), JointStateEncoder(("x",), ("position", "velocity")).encode
    for k in range(400):
        publish(encode(time.time_ns(), [0.02 * min(1.0, k / 200)], [0.0]))
        time.sleep(1e-3)
        if run.process.poll() is not None:
            break
    code, said = run.end()
    assert code == 1, said
    stopped(run, "compensate", "the motion was stopped")
    assert compensation(graph, 1)[-1] == 0.0


def test_a_stall_stops_the_motion(start: Start, graph: Graph, commission: Any) -> None:
    """The drive has less force than the friction."""
    start("stage_node", table("controller: {effort_limit: 2.0}"))
    graph.listen("friction_compensation", "reference")
    run = commission()
    code, said = run.end()
    assert code == 1, said
    stopped(run, "check", "stalls", "enough force")
    is_at_rest_without_force(graph)


def test_a_wrong_sign_of_the_effort_stops_it(start: Start, graph: Graph, commission: Any) -> None:
    """Position and effort are in one topic, as ros2_control has them, and the reference has another name."""
    names = {"position": "/joint_states", "control_effort": "/joint_states", "reference": COMMAND}
    remaps = [part for key, name in names.items() for part in ("-r", f"{key}:={name}")]
    start("stage_node", table(axis="effort_scale: -1.0"), "--ros-args", *remaps)
    graph.listen("friction_compensation", COMMAND)
    run = commission(*(part for key, name in names.items() for part in ("--topic", f"{key}={name}")))
    code, said = run.end()
    assert code == 1, said
    stopped(run, "check", "effort_scale", "sign is wrong")
    is_at_rest_without_force(graph, COMMAND)


def test_a_table_that_says_nothing_is_one_sentence(commission: Any, ros: None) -> None:
    run = commission()
    code, said = run.end()
    assert code == 1, said
    stopped(run, "check", "no message of position arrives")


def test_only_a_new_stamp_is_a_sign_of_life(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [1.0]
    monkeypatch.setattr("sgms_observer.nodes.axis_listener.time.monotonic", lambda: now[0])
    listener = AxisListener(AxisSettings(name="x"))
    encode = JointStateEncoder(("x",), ("position", "effort")).encode
    for topic, take in ((POSITION, listener._take_position), (EFFORT, listener._take_effort)):
        take(encode(5_000, [0.0], [1.0]))
        now[0] += 1.0
        for stamp in (5_000, 4_000):
            take(encode(stamp, [0.1], [1.0]))
        assert listener.heard_at[topic] == now[0] - 1.0 and listener.repeats_stamp(topic)
        take(encode(6_000, [0.1], [1.0]))
        assert listener.heard_at[topic] == now[0] and not listener.repeats_stamp(topic)
    assert [stamp for stamp, _ in listener.positions] == [5_000, 6_000]


@pytest.mark.parametrize(
    ("efforts", "missing"), [(range(10, 90), 0), (range(50), 30), (range(40, 100), 20), (range(5000, 5100), 100)]
)
def test_positions_lack_an_effort_unless_the_topics_were_only_connected_one_after_the_other(
    efforts: range, missing: int
) -> None:
    """A tenth of a second without efforts is the start. An effort that stops, or has another clock, is a fault."""
    listener = AxisListener(AxisSettings(name="x"))
    encode = JointStateEncoder(("x",), ("position", "effort")).encode
    period = 10_000_000  # ns
    for place in range(100):
        listener._take_position(encode(place * period, [0.1], [1.0]))
    for place in efforts:
        listener._take_effort(encode(place * period, [0.1], [1.0]))
    found = [stamp // period for stamp, _ in listener.between_efforts(0.2)]
    assert len(set(found) - set(efforts)) == missing
    assert set(efforts).intersection(range(100)) <= set(found)


def test_a_message_behind_a_recording_meets_no_closed_bag(tmp_path: Path) -> None:
    """A motion that is held up ends its recording, and the listener goes on to hear whether the table comes back."""
    listener, encoder = AxisListener(AxisSettings(name="x")), JointStateEncoder(("x",), ("position",))
    listener.span = (0, 10**9)
    with pytest.raises(HeldUp), listener.recording(tmp_path / "bag"):
        listener.record("reference", 1, encoder.encode(1, [0.0]))
        raise HeldUp("a busy computer")
    listener.record("reference", 2, encoder.encode(2, [0.0]))
    assert not listener.is_recording
