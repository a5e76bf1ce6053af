"""The steps that identify the model: excite, record, identify and diagnose."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from sgms_observer.application.commission.ledger import (
    EXCITATION,
    EXPERIMENTS,
    IDENTIFIED,
    LEARN_BAG,
    LIGHTS,
    OWN_BAG,
    OWN_MOTION,
    OWN_MOTION_GAP,
)
from sgms_observer.application.commission.motion import (
    Motion,
    checked,
    learning_motion,
    read_motion,
    representative_motion,
)
from sgms_observer.application.commission.session import Session
from sgms_observer.application.diagnose import DiagnoseRequest, diagnose_bags
from sgms_observer.application.identify import IdentifyJob, identify_bags
from sgms_observer.arrays import Floats
from sgms_observer.bags.reader import read_joint_states
from sgms_observer.diagnosis.diagnosis import Options
from sgms_observer.diagnosis.gap import WeightedResidual, effort_rms, residuals
from sgms_observer.diagnosis.model import Model
from sgms_observer.diagnosis.motion import long_enough, motion_of
from sgms_observer.diagnosis.questions import questions_of
from sgms_observer.diagnosis.whitened import data_with_own_noise
from sgms_observer.errors import ConfigurationError, RecordingError
from sgms_observer.offline.band import choose_band
from sgms_observer.offline.recording import read_recordings
from sgms_observer.settings.axis import AxisSettings, FrictionSettings
from sgms_observer.settings.load import load_settings
from sgms_observer.settings.write import write_settings
from sim_plant.reference_file import points_from


def _own_rows(path: Path, axis: AxisSettings) -> tuple[Floats, Floats]:
    """Return times [s] and set-points [m] of a motion: of a bag, or of a CSV with columns for time and position."""
    if path.suffix == ".csv":
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise RecordingError(f"{path} cannot be read: {error}; give a CSV as sgms excite writes it") from None
        return points_from(text, path)
    states = read_joint_states(path, "reference")
    if axis.name not in states.names or not states.stamp_ns.size:
        raise ConfigurationError([f"{path} has no reference of axis {axis.name}; record one with the topic reference"])
    stamps, rows_of = np.unique(states.stamp_ns, return_index=True)
    position = axis.position_scale * states.position[rows_of, states.names.index(axis.name)]
    known = np.isfinite(position)
    return (stamps[known] - stamps[0]) * 1e-9, position[known]


MAX_RECORD_TIME, RECORD_SHARE = 25.0, 0.08
"""Largest length of the fitted recording [s], and its largest share of the time for everything."""
OFFSET = "offset"
"""The effect that identification adds to a file."""
WITHOUT_OFFSET = "identification/without_offset.yaml"
"""The identified file without the offset that identification added."""
MAX_RATIO_OF_BETTER = 0.8
"""Identified values replace the file's where their gap on the user's own motion is below this multiple of the
file's."""

Found = tuple[str, list[str]]


def largest_deflection(friction: FrictionSettings) -> float:
    """Return the travel over which the friction reverses after a reversal [m]."""
    deflection = np.array(friction.element_fraction) * friction.static_force / np.array(friction.element_stiffness)
    return 2.0 * float(np.max(deflection))


def excite(session: Session) -> Found:
    """Build the motions: the excitation, and the user's own motion or a representative one."""
    plan, axis = session.plan, session.axis
    period, limits = plan.settings.sample_period, plan.limits
    seconds = min(MAX_RECORD_TIME, RECORD_SHARE * plan.request.seconds)
    presliding, stribeck_velocity = largest_deflection(axis.friction), axis.friction.stribeck_velocity
    learn = learning_motion(limits, period, presliding, stribeck_velocity, seconds)
    if plan.request.motion:
        source = Path(plan.request.motion)
        user_motion = read_motion(source, _own_rows(source, axis), session.origin, period)
        motion_name = str(source)
    else:
        user_motion, motion_name = representative_motion(limits, period), "the representative motion"
    checked(learn, limits, session.origin, "the excitation")
    checked(user_motion, limits, session.origin, motion_name)
    learn.write(session.path(EXCITATION))
    user_motion.write(session.path(OWN_MOTION))
    readable = axis.units.readable
    return (
        f"excitation of {learn.duration:.1f} s over {readable(float(np.ptp(learn.position)))}, at up to"
        f" {readable(learn.peak_speed, 'm/s')} and {readable(learn.peak_acceleration, 'm/s^2')}; {motion_name}:"
        f" {user_motion.duration:.1f} s over {readable(float(np.ptp(user_motion.position)))}, at up to"
        f" {readable(user_motion.peak_speed, 'm/s')} and {readable(user_motion.peak_acceleration, 'm/s^2')}",
        [EXCITATION, OWN_MOTION],
    )


def record(session: Session) -> Found:
    """Play both motions and record them."""
    excitation, user_motion = (load_motion(session, name) for name in (EXCITATION, OWN_MOTION))
    session.need(session.duration_of(excitation) + session.duration_of(user_motion), "record")
    for motion, bag, purpose in (
        (excitation, LEARN_BAG, "excitation"),
        (user_motion, OWN_BAG, "own motion, without compensation"),
    ):
        session.confirm_motion(motion, purpose)
        session.record(motion, bag)
    return f"recorded {excitation.duration + user_motion.duration:.0f} s in two bags", [LEARN_BAG, OWN_BAG]


def identify(session: Session) -> Found:
    """Identify the axis; its values replace the file's where they predict the user's own motion clearly better."""
    request, axis = session.plan.request, session.axis
    learn, own_bag = str(session.path(LEARN_BAG)), str(session.path(OWN_BAG))
    job = IdentifyJob(
        (learn,), request.config, str(session.path(IDENTIFIED)), (axis.name,), axis.friction.model, is_overwriting=True
    )
    identified = identify_bags(job, _titled(session))
    found = next(one for one in load_settings(identified.path).axes if one.name == axis.name)
    given, fitted = unexplained(own_bag, [axis, found])
    session.ledger.facts[OWN_MOTION_GAP] = {"file": 100.0 * given, "identified": 100.0 * fitted}
    is_better = fitted < MAX_RATIO_OF_BETTER * given
    if is_better:
        session.ledger.facts["model"] = _without_new_offset(session, found)
    else:
        session.ledger.facts["model"] = None
    verdict = (
        "the diagnosis starts from the identified values"
        if is_better
        else "not clearly less, so the diagnosis starts from the file's values"
    )
    return (
        f"on your own motion the gap of the file's values is {100 * given:.1f} % of the rms {axis.units.effort_word},"
        f" that of the identified ones {100 * fitted:.1f} %; {verdict}",
        [IDENTIFIED],
    )


def _without_new_offset(session: Session, found: AxisSettings) -> str:
    """Return the file to diagnose: the identified one, without an offset that the user's own file does not list.

    While the axis slides, an offset imitates every force that depends on the direction, and among equals an effect of
    the file comes first. The user's file says nothing of an offset, so none comes first.
    """
    file_effects = {item.name for item in session.axis.effects}
    names = [item.name for item in found.effects if item.name != OFFSET or item.name in file_effects]
    if len(names) == len(found.effects):
        return IDENTIFIED
    changes: dict[str, Any] = {"effects.names": names, "effects.offset": None}
    write_settings(load_settings(session.path(IDENTIFIED)), session.path(WITHOUT_OFFSET), {session.axis.name: changes})
    return WITHOUT_OFFSET


def diagnose(session: Session) -> Found:
    """Find the effects that the model lacks."""
    session.ledger.facts[EXPERIMENTS] = []
    return diagnose_bags_of(session, [LEARN_BAG], "diagnosis")


def diagnose_bags_of(session: Session, bags: Sequence[str], out: str) -> Found:
    """Diagnose recordings into a folder; note effects and model.

    Args:
        session: the session.
        bags: fitted recordings, relative to the folder.
        out: folder of the diagnosis, relative to the folder.
    """
    begun = time.monotonic()
    ledger, axis = session.ledger, session.axis
    base = ledger.facts.get("model") or ""
    start = str(session.path(base)) if base else session.plan.request.config
    request = DiagnoseRequest(
        [str(session.path(bag)) for bag in bags], start, str(session.path(out)), [str(session.path(OWN_BAG))],
        axis.name, workers=os.cpu_count() or 1,
    )  # fmt: skip
    with _titled(session)("diagnose") as show:
        done = diagnose_bags(request, show)
    result = json.loads(session.path(f"{out}/result.json").read_text(encoding="utf-8"))
    ledger.effects = result["effects"]
    ledger.facts["gap"] = result["gap"]
    ledger.facts["verdict"] = result["verdict"]
    ledger.facts["diagnosis"] = out
    ledger.facts["bags"] = list(bags)
    lights = questions_of(done.answer, done.checks, done.tracking, Options(request.tolerance), done.units)
    ledger.facts[LIGHTS] = [asdict(light) for light in lights]
    ledger.facts["diagnosis_seconds"] = time.monotonic() - begun
    for warning in done.answer.warnings:
        session.warn(f"Warning: {warning}.")
    gap = result["gap"]
    named = ", ".join(
        effect["name"] + (f" (or {', '.join(effect['alternatives'])})" if effect["alternatives"] else "")
        for effect in result["effects"]
    )
    return (
        f"{result['verdict']}{': ' + named if named else ''}; gap on your own motion {gap['before']:.3g} %"
        f" of the rms {axis.units.effort_word} before, {gap['after']:.3g} % after (floor {gap['floor']:.3g} %)",
        [f"{out}/result.json", f"{out}/augmented.yaml", f"{out}/report.html"],
    )


def residual_of(bag: str, axis: AxisSettings) -> WeightedResidual:
    """Return the residual of a model in a recording, as the gap counts it."""
    pieces = long_enough(read_recordings(bag, axis))
    band = choose_band(pieces, axis).corner
    motions = [motion_of(piece, band=band) for piece in pieces]
    model = Model.of(axis)
    return WeightedResidual(motions, residuals(model, motions), data_with_own_noise(motions, model).weights)


def unexplained(bag: str, axes: Sequence[AxisSettings]) -> list[float]:
    """Return the gaps of models: rms of measured minus modelled effort over the rms effort of a recording.

    All have the same weights: for each sample the smallest one that any of the models gives it.

    Args:
        bag: the recording.
        axes: one axis with the values of each model.
    """
    rests = [residual_of(bag, axis) for axis in axes]
    weights = [np.minimum.reduce(parts) for parts in zip(*(one.weights for one in rests), strict=True)]
    effort = effort_rms(rests[0].motions, weights)
    return [replace(one, weights=weights).rms / effort for one in rests]


def load_motion(session: Session, name: str) -> Motion:
    """Return a motion that an earlier step wrote."""
    rows = np.loadtxt(session.path(name), delimiter=",", skiprows=1, ndmin=2)
    return Motion(session.plan.settings.sample_period, rows[:, 1])


def _titled(session: Session) -> Callable[[str], Any]:
    """Return a context manager for long work; its value is called with the completed share, 0 to 1."""

    @contextmanager
    def progress(title: str) -> Iterator[Callable[[float], None]]:
        yield lambda share: session.progress(title, share)

    return progress
