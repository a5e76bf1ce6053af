"""EMPS from the raw files to a report: convert, identify, observe; then diagnose, and the same through the nodes.

    python examples/emps.py --data FOLDER_WITH_MAT_FILES --out out/emps [--diagnose] [--live]

The data are measurements by A. Janot, M. Gautier and M. Brunot, "Data set and reference models of EMPS", 2019 Workshop
on Nonlinear System Identification Benchmarks; see docs/emps.md.
"""

from __future__ import annotations

import argparse
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from sgms_observer.application.simulate import write_estimates
from sgms_observer.bags.conversion import parse_map, read_table, write_table
from sgms_observer.bags.reader import read_joint_states, read_samples
from sgms_observer.bags.writer import BagWriter
from sgms_observer.cli.main import main as sgms
from sgms_observer.diagnosis.homing import pitch_of, position_offset, with_position_offset
from sgms_observer.diagnosis.model import Model, predict
from sgms_observer.diagnosis.motion import Motion, motion_of
from sgms_observer.errors import SgmsError
from sgms_observer.identification.least_squares import (
    ASYMMETRIC,
    InverseModelFit,
    decimate_from_end,
    fit_inverse_model,
    regression,
)
from sgms_observer.nodes.transport import claim_domain
from sgms_observer.observer.axis_observer import AxisObserver
from sgms_observer.observer.samples import Estimates, Samples
from sgms_observer.offline.recording import Recording, join_samples, read_recordings, recordings_from_samples
from sgms_observer.report.drawing import Line, Panel, time_plot
from sgms_observer.report.page import Page, Plot, Section, render_page
from sgms_observer.settings.load import load_settings

Floats = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[1]
START = ROOT / "config" / "emps.yaml"
FILES = {"train": "DATA_EMPS.mat", "pulses": "DATA_EMPS_PULSES.mat"}
MAP = ("time=t", "position=qm", "control_effort=vir*gtau", "reference=qg")
PERIOD = 1.0e-3
DECIMATION = 10
"""The published force errors are at 100 Hz."""
BORDER = 49
"""Samples at the start where the filters settle."""
FIRST_STROKE = 3.5
"""Length of the pulses record's first stroke [s]; it tells where on the screw the record counts from."""
PUBLISHED = {"mass": 95.1089, "viscous_coefficient": 203.5034, "coulomb_force": 20.3935, "offset": -3.1648}
PUBLISHED_ERROR = {"train": 4.08, "pulses": 5.98, "train, asymmetric": 3.11}


@dataclass(frozen=True)
class Observed:
    """What the observer said of one record."""

    name: str
    samples: Samples
    estimates: Estimates

    @property
    def sentence(self) -> str:
        """Innovations and one-step force error in one sentence."""
        estimates = self.estimates
        at = np.isfinite(estimates.innovation)
        innovation, expected = estimates.innovation[at], estimates.innovation_std[at]
        force = float(np.sqrt(np.mean(self.samples.effort[at] ** 2)))
        rms = float(np.sqrt(np.mean(innovation**2)))
        nis = float(np.mean((innovation / expected) ** 2))
        step = float(np.median(np.diff(self.samples.stamp_ns[at]))) * 1e-6
        return (
            f"{self.name}: one-step force error {rms:.3f} N rms = {100.0 * rms / force:.2f} % of the rms force,"
            f" {step:.0f} ms ahead; mean innovation {float(np.mean(innovation)):+.3f} N; mean squared innovation over"
            f" its variance {nis:.2f}; {int(at.sum())} corrections"
        )


def main() -> int:
    """Run the example."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    default = os.environ.get("SGMS_DATA", str(ROOT.parent / "shared" / "data"))
    parser.add_argument("--data", default=str(Path(default) / "emps"), help="folder with the two .mat files")
    parser.add_argument("--out", default="out/emps", help="folder to write (emptied first)")
    parser.add_argument("--diagnose", action="store_true", help="also diagnose the train record, judge on the pulses")
    parser.add_argument("--live", action="store_true", help="also play the train record through observer_node")
    args = parser.parse_args()
    out = Path(args.out)
    try:
        lines, observed = run(Path(args.data), out)
        if args.diagnose:
            lines += diagnose(out)
        if args.live:
            lines.append(live(out))
    except SgmsError as error:
        print(error, file=sys.stderr)
        return 1
    for line in lines:
        print(line)
    (out / "report.html").write_text(report(lines, observed), encoding="utf-8")
    print(f"wrote {out / 'report.html'}")
    return 0


def run(data: Path, out: Path) -> tuple[list[str], list[Observed]]:
    """Convert, identify and observe.

    Args:
        data: folder with the two .mat files.
        out: folder to write.

    Returns:
        Sentences, and what the observer said of each record.
    """
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    recordings = {}
    for name, file in FILES.items():
        write_table(read_table(data / file, parse_map(MAP)), out / name, "x")
        recordings[name] = recordings_from_samples(_samples(out / name), name)[0]
    lines = published(recordings)
    for model in ("least_squares", "sgms"):
        arguments = ["identify", str(out / "train"), "--config", str(START), "--model", model]
        if sgms([*arguments, "--out", str(out / f"{model}.yaml")]) != 0:
            raise SgmsError(f"sgms identify --model {model} failed")
    observed = []
    for model in ("least_squares", "sgms"):
        axis = load_settings(out / f"{model}.yaml").axes[0]
        for name in FILES:
            samples = _samples(out / name)
            estimates = AxisObserver(axis, PERIOD).step(samples)
            observed.append(Observed(f"{name}, {model}.yaml", samples, estimates))
            lines.append(observed[-1].sentence)
            if model == "sgms":
                with BagWriter(out / f"{name}_observed") as bag:
                    write_estimates(bag, ("x",), (estimates,))
    return lines, observed


def published(recordings: dict[str, Recording]) -> list[str]:
    """Return the published least-squares figures beside ours."""
    fit: InverseModelFit = fit_inverse_model([_published_timing(recordings["train"])])
    lines = ["least squares, published / here:"]
    lines += [
        f"  {name}: {value:g} / {fit.value(name):.4f} ({100.0 * (fit.value(name) / value - 1.0):+.3f} %)"
        for name, value in PUBLISHED.items()
    ]
    asymmetric = fit_inverse_model([_published_timing(recordings["train"])], ASYMMETRIC)
    errors = {
        "train": fit.relative_error,
        "pulses": inverse_model_error(fit, _published_timing(recordings["pulses"])),
        "train, asymmetric": asymmetric.relative_error,
    }
    lines += [
        f"  relative force error, {name}: {PUBLISHED_ERROR[name]:.2f} % / {100.0 * error:.2f} %"
        for name, error in errors.items()
    ]
    return lines


def inverse_model_error(fit: InverseModelFit, recording: Recording) -> float:
    """Return the relative force error of a fit on another recording: norm of the residual over norm of the force.

    Args:
        fit: fit to other recordings.
        recording: the recording.
    """
    part = regression(recording, fit.names, fit.cutoff)
    return float(np.linalg.norm(part.effort - part.regressor @ fit.values) / np.linalg.norm(part.effort))


def _published_timing(recording: Recording) -> Recording:
    """Return the record with the period its authors state: 1 kHz."""
    return replace(recording, period=PERIOD)


def _samples(bag: Path) -> Samples:
    return join_samples(list(read_samples(bag, "x", PERIOD)))


def diagnose(out: Path) -> list[str]:
    """Diagnose the train record alone, starting from the published model, and judge the result on the pulses record.

    Args:
        out: folder of ``run``; the diagnosis goes into its folder ``diagnosis``.

    Returns:
        Sentences with the force error of both records, before and after.
    """
    if sgms(["diagnose", str(out / "train"), "--config", str(START), "--out", str(out / "diagnosis")]) != 0:
        raise SgmsError("sgms diagnose failed")
    augmented = out / "diagnosis" / "augmented.yaml"
    effects = ", ".join(item.name for item in load_settings(augmented).axes[0].effects)
    lines = [f"diagnosed on the train record alone: {effects}"]
    axes = [load_settings(config).axes[0] for config in (START, augmented)]
    models = [Model.of(axis) for axis in axes]
    motions = {name: motion_of(read_recordings(out / name, axes[0])[0]) for name in FILES}
    for name, motion in motions.items():
        before, after = (force_error(predict(model, motion).residual, motion) for model in models)
        lines.append(f"  relative force error, {name}: {before:.2f} % -> {after:.2f} %")
    if pitch_of(models[1].effects) is not None:
        lines.append(homed(models[0], models[1], motions["pulses"]))
    return lines


def homed(given: Model, augmented: Model, motion: Motion) -> str:
    """Return what the augmented model leaves on a record whose place on the screw its first stroke tells.

    Until that is over the place is not known, and the model does without its ripple: nothing is told ahead of time.

    Args:
        given: model as it was.
        augmented: model with its ripple.
        motion: of the record.
    """
    place = position_offset(augmented, motion, FIRST_STROKE)
    plain = replace(augmented, effects=tuple(item for item in augmented.effects if pitch_of([item]) is None))
    there = predict(augmented, with_position_offset(motion, place)).residual
    whole = np.where(motion.time < FIRST_STROKE, predict(plain, motion).residual, there)
    rest = slice(round(FIRST_STROKE / PERIOD / DECIMATION), None)
    as_given, as_is = (predict(model, motion).residual for model in (given, augmented))
    later = [force_error(residual, motion, rest) for residual in (as_given, as_is, there)]
    both = [force_error(residual, motion) for residual in (as_given, whole)]
    return (
        f"  pulses, homed by the first stroke ({1e3 * place:.2f} mm along the screw from where the train record"
        f" counts): the rest {later[0]:.2f} % -> {later[1]:.2f} % unhomed, {later[2]:.2f} % homed; the whole, without"
        f" ripple until the first stroke is over, {both[0]:.2f} % -> {both[1]:.2f} %"
    )


def force_error(residual: Floats, motion: Motion, span: slice = slice(None)) -> float:
    """Return a force error in the published measure: filtered forwards and backwards, decimated [%].

    Args:
        residual: force that a model leaves unexplained, shape (n,) [N].
        motion: of the record.
        span: rows at 100 Hz to count.
    """
    rows = decimate_from_end(np.column_stack([residual, motion.effort])[BORDER:], DECIMATION)[span]
    return float(100.0 * np.linalg.norm(rows[:, 0]) / np.linalg.norm(rows[:, 1]))


def live(out: Path) -> str:
    """Play the train record through observer_node on the ROS graph and compare with the replay.

    Args:
        out: folder of ``run``; the recorded topics go there.
    """
    environment = {
        **os.environ,
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "ROS_DOMAIN_ID": os.environ.get("ROS_DOMAIN_ID", str(claim_domain())),
    }
    python = [sys.executable, "-m"]
    node = [*python, "sgms_observer.nodes.observer_node", "--ros-args", "--params-file", str(out / "sgms.yaml")]
    record = [*python, "sgms_observer.cli.main", "record", "friction_estimate", "--out", str(out / "live")]
    play = [*python, "sgms_observer.cli.main", "play", str(out / "train")]
    processes = [subprocess.Popen(command, env=environment, cwd=ROOT) for command in (node, record)]
    try:
        time.sleep(8.0)
        subprocess.run(play, env=environment, cwd=ROOT, check=True)
        time.sleep(2.0)
    finally:
        for process in processes:
            process.send_signal(signal.SIGINT)
        for process in processes:
            process.wait(timeout=20.0)
    recorded = read_joint_states(out / "live", "friction_estimate")
    replayed = read_joint_states(out / "train_observed", "friction_estimate")
    common, first, second = np.intersect1d(recorded.stamp_ns, replayed.stamp_ns, return_indices=True)
    same = np.array_equal(recorded.effort[first], replayed.effort[second])
    return (
        f"live through the nodes: {len(common)} of {len(replayed.stamp_ns)} estimates arrived;"
        f" {'the same bits as' if same else 'they differ from'} the replay"
    )


def report(lines: list[str], observed: list[Observed]) -> str:
    """Return a self-contained page.

    Args:
        lines: sentences with the figures.
        observed: what the observer said of each record.
    """
    sections = [Section("Figures", lines), *(Section(item.name, plots=[_plot(item)]) for item in observed)]
    verdict = "A measured axis, identified and observed from position and effort."
    return render_page(Page("EMPS: identified and observed", verdict, sections))


def _plot(item: Observed) -> Plot:
    """Return force and innovations over time."""
    seconds = (item.samples.stamp_ns - item.samples.stamp_ns[0]) * 1e-9
    estimates = item.estimates
    deviation = 2.0 * estimates.innovation_std
    panels = [
        Panel(
            "force [N]",
            [
                Line("actuator force", item.samples.effort, "measured"),
                Line("estimated friction", estimates.friction, "estimate"),
            ],
        ),
        Panel(
            "innovation [N]",
            [
                Line("innovation", _held(estimates.innovation), "measured"),
                Line("2 standard deviations", _held(deviation), "reference"),
                Line("the same, negative", _held(-deviation), "reference"),
            ],
        ),
    ]
    return time_plot(item.name, f"Force and innovation over time, {item.name}.", seconds, panels)


def _held(values: Floats) -> Floats:
    """Return what is known at corrections only, held until the next one."""
    latest = np.maximum.accumulate(np.where(np.isfinite(values), np.arange(len(values)), 0))
    return np.asarray(values[latest], dtype=np.float64)


if __name__ == "__main__":
    sys.exit(main())
