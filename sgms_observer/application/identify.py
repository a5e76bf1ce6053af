"""Identify the axes of a parameter file from bags, and write the file with the identified values."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from sgms_observer.application.effort_cut_off import cut_effort_warnings
from sgms_observer.application.force_balance import fit_force_balance
from sgms_observer.application.gravity_unit import gravity_unit, gravity_warnings
from sgms_observer.errors import ConfigurationError, RecordingError
from sgms_observer.identification.answer import Answer, identification_answer, judged_on_held_out, least_squares_answer
from sgms_observer.identification.identify import Identification, IdentifyOptions, identify
from sgms_observer.identification.least_squares import fit_inverse_model, is_reversed
from sgms_observer.identification.report import IdentifiedAxis, identification_page, report_path
from sgms_observer.identification.table import Row
from sgms_observer.identification.trace import (
    Traces,
    least_squares_traces,
    traces_of,
    unexplained_share,
    unexplained_variation,
)
from sgms_observer.observer.all_axes import COUPLING
from sgms_observer.offline.band import choose_band, refuse_cutoff
from sgms_observer.offline.recording import Recordings, read_recordings
from sgms_observer.report.page import render_page
from sgms_observer.settings.axis import AxisSettings, Settings
from sgms_observer.settings.load import load_settings
from sgms_observer.settings.node_parameters import missing_parameters, refuse_missing
from sgms_observer.settings.write import settings_text
from sgms_observer.settings.yaml_text import comments_in, with_comments
from sgms_observer.whole_file import refuse_existing_files, try_folder, write_text

INVERSE_MODEL = "least_squares"
HIGHEST_LEAST_SQUARES_CUTOFF = 100.0
"""Highest corner of the inverse dynamic model [Hz]: rigid bodies end there."""
_PROVENANCE = "Identified by sgms identify"
_STALE = ("(95 %)", "not identifiable")


@dataclass(frozen=True)
class IdentifyJob:
    """Inputs of an identification.

    Attributes:
        bags: fitted recordings.
        config: parameter file to start from.
        out: parameter file to write.
        axes: names of the axes; empty for all of the file.
        model: ``sgms``, ``gms`` or ``least_squares``.
        elements: number of elements; 0 lets the held-out error choose.
        cutoff: corner of the band [Hz]; 0 chooses it.
        holdout: held-out recordings: the model is evaluated on them and not fitted to them.
        topics: names of the inputs where they differ.
        is_overwriting: replace a file that is there.
    """

    bags: tuple[str, ...]
    config: str
    out: str
    axes: tuple[str, ...] = ()
    model: str = "sgms"
    elements: int = 0
    cutoff: float = 0.0
    holdout: tuple[str, ...] = ()
    topics: Mapping[str, str] = field(default_factory=dict)
    is_overwriting: bool = False


@dataclass(frozen=True)
class Identified:
    """Result of an identification.

    Attributes:
        path: the parameter file that was written.
        report: the report beside it.
        axes: result of each axis.
    """

    path: str
    report: str
    axes: tuple[IdentifiedAxis, ...]

    @property
    def is_usable(self) -> bool:
        """Whether the whole file may be used as it is."""
        return all(axis.answer.is_usable for axis in self.axes)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Return the warnings of all axes."""
        return tuple(warning for axis in self.axes for warning in axis.answer.warnings)

    def as_json(self) -> dict[str, Any]:
        """Return the result that ``--json`` prints."""
        axes = {axis.name: _axis_json(axis) for axis in self.axes}
        return {
            "schema": 1,
            "yaml": self.path,
            "report": self.report,
            "usable": self.is_usable,
            "warnings": self.warnings,
            "axes": axes,
        }


def identify_bags(
    job: IdentifyJob, progress: Callable[[str], AbstractContextManager[Callable[[float], None]]]
) -> Identified:
    """Identify the axes, write the parameter file and the report beside it.

    Args:
        job: inputs and options.
        progress: returns for a title a context manager; its value is called with the completed share, 0 to 1.

    Raises:
        ConfigurationError, RecordingError, DataError: one sentence each.
    """
    settings = load_settings(job.config)
    wanted = settings.wanted_axes(job.axes, job.config)
    refuse_missing(settings, [])  # axes; a mass may be identified instead
    refuse_cutoff(job.cutoff)
    report = report_path(job.out, job.is_overwriting)
    refuse_existing_files([job.out, report], job.is_overwriting)
    try_folder(Path(job.out).parent)
    hashes = [bag_hash(bag) for bag in job.bags]
    found = []
    for axis in settings.axes:
        if axis in wanted:
            is_coupled = any(effect.name == COUPLING for effect in axis.effects)
            other = settings.coupled_to(axis) if is_coupled else None
            pieces, unseen = (_read(bags, axis, other, job) for bags in (job.bags, job.holdout))
            with progress(f"identify {axis.name}") as show:
                found.append(_identified(pieces, unseen, axis, settings.sample_period, job, show))
    _refuse_unknown_mass(settings, found)
    _write(settings, job, hashes, found)
    page = identification_page(found, job.out, job.bags, job.holdout, len(found) < len(settings.axes))
    write_text(render_page(page), report)
    return Identified(job.out, str(report), tuple(found))


def _refuse_unknown_mass(settings: Settings, found: Sequence[IdentifiedAxis]) -> None:
    """Refuse to write a mass that neither the file gives nor the recordings show: it would be that of an example."""
    masses = {axis.name: next(row for row in axis.answer.rows if row.name == "mass") for axis in found}
    unknown = [axis for axis in settings.axes if axis.name in masses and not _is_shown(masses[axis.name])]
    names = [sentence.split(" ")[0] for sentence in missing_parameters(settings, unknown)]
    if names:
        raise ConfigurationError(
            [
                f"{name} must be given, as the recordings do not show it; weigh the mass, or record harder acceleration"
                for name in names
            ]
        )


def _is_shown(row: Row) -> bool:
    """Return whether a value is larger than half its interval; a value that was not estimated has none."""
    return row.half_width < abs(row.value)


def _read(bags: Sequence[str], axis: AxisSettings, other: AxisSettings | None, job: IdentifyJob) -> Recordings:
    """Read bags as even pieces."""
    pieces = Recordings(())
    for bag in bags:
        pieces += read_recordings(bag, axis, other, topics=job.topics)
    return pieces


def _identified(
    pieces: Recordings,
    unseen: Recordings,
    axis: AxisSettings,
    sample_period: float,
    job: IdentifyJob,
    show: Callable[[float], None],
) -> IdentifiedAxis:
    """Identify one axis with the chosen model."""
    notes = (*pieces.notes, *unseen.notes)
    unexplained: float | None = None
    variation: float | None = None
    is_converged: bool | None = None
    if job.model == INVERSE_MODEL:
        cutoff = job.cutoff or min(HIGHEST_LEAST_SQUARES_CUTOFF, choose_band(pieces, axis).corner)
        answer, traces = _least_squares(pieces, unseen, axis, cutoff)
    else:
        options = IdentifyOptions(model=job.model, cutoff=job.cutoff, count=job.elements)
        result: Identification = identify(pieces, axis, options, show)
        answer = identification_answer(result, axis, sample_period)
        traces = traces_of(result, axis, pieces, unseen)
        cutoff, unexplained, is_converged = result.cutoff, result.unexplained, result.is_converged
        variation = result.unexplained_variation
    cut_off = [f"{axis.name}: {sentence}" for sentence in cut_effort_warnings(pieces)]
    warnings = [f"Warning: {sentence}" for sentence in (*cut_off, *_gravity_warnings(pieces, axis))]
    answer = replace(answer, warnings=(*answer.warnings, *warnings))
    if traces.held_out:
        held_out = unexplained_share(traces.held_out)
        word = axis.units.effort_word
        sentence = f"{axis.name}: {100.0 * held_out:.2f} % of the rms {word} unexplained on held-out bags"
        answer = replace(answer, summary=(*answer.summary, sentence))
        answer = judged_on_held_out(answer, axis, unexplained_variation(traces.held_out))
    return IdentifiedAxis(axis.name, axis.units, answer, traces, cutoff, unexplained, variation, is_converged, notes)


def _gravity_warnings(pieces: Recordings, axis: AxisSettings) -> list[str]:
    """Return the sentence that gravity asks for another joint type, or for another unit of the angle, if it does."""
    balance = fit_force_balance(pieces, axis, has_gravity=True)
    return [] if balance is None else gravity_warnings(axis.name, gravity_unit(pieces, balance), axis.joint_type)


def _least_squares(pieces: Recordings, unseen: Recordings, axis: AxisSettings, cutoff: float) -> tuple[Answer, Traces]:
    """Fit the inverse dynamic model; reverse an effort with the wrong sign and report it."""
    fit = fit_inverse_model(pieces, cutoff=cutoff, is_revolute=axis.units.is_revolute)
    opposed = is_reversed(fit)
    if opposed:
        turned = [replace(piece, effort=-piece.effort) for piece in pieces]
        fit = fit_inverse_model(turned, cutoff=cutoff, is_revolute=axis.units.is_revolute)
    return least_squares_answer(fit, axis, opposed), least_squares_traces(fit, pieces, unseen, opposed)


def _write(settings: Settings, job: IdentifyJob, hashes: Sequence[str], found: Sequence[IdentifiedAxis]) -> None:
    """Write the parameter file, with the comments of the start file, and read it back."""
    remarks = {f"{axis.name}.{name}": remark for axis in found for name, remark in axis.answer.remarks.items()}
    sentences = [sentence for axis in found for sentence in (*axis.answer.summary, *axis.answer.warnings)]
    changes = {axis.name: axis.answer.changes for axis in found}
    text = settings_text(settings, job.out, changes, remarks)
    try:
        comments, last = comments_in(Path(job.config).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise RecordingError(f"{job.config} cannot be read: {error}; check the path") from None
    if comments and any(line.startswith(_PROVENANCE) for line in comments[0].above):
        comments = (replace(comments[0], above=()), *comments[1:])
    text = with_comments(text, comments, last, lambda comment: any(word in comment for word in _STALE))
    head = _provenance(job.bags, hashes, sentences)
    write_text("\n".join(f"# {line}".rstrip() for line in head.splitlines()) + "\n" + text, job.out)
    load_settings(job.out)


def bag_hash(path: str | Path) -> str:
    """Return the SHA-256 of a bag: of its files' names and contents, in the order of their names.

    Raises:
        RecordingError: if it cannot be read.
    """
    root = Path(path)
    digest = hashlib.sha256()
    try:
        files = [root] if root.is_file() else sorted(entry for entry in root.rglob("*") if entry.is_file())
        for file in files:
            digest.update(file.name.encode())
            with open(file, "rb") as handle:
                while part := handle.read(1 << 20):
                    digest.update(part)
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror or error}; check the path") from None
    return digest.hexdigest()


def _provenance(names: Sequence[str], hashes: Sequence[str], summary: Sequence[str]) -> str:
    """Return the lines at the head of the YAML: each recording with its SHA-256, then sentences about the result."""
    date = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    lines = [f"{_PROVENANCE} on {date} from"]
    lines += [f"  {Path(name).name}  sha256 {digest}" for name, digest in zip(names, hashes, strict=True)]
    return "\n".join([*lines, *summary])


def _axis_json(axis: IdentifiedAxis) -> dict[str, Any]:
    """Return an axis as ``--json`` prints it."""
    rows = axis.answer.rows
    return {
        "parameters": {
            row.name: {"value": row.value, "half_width": row.half_width, "unit": row.unit, "shown": row.is_identifiable}
            for row in rows
        },
        "unexplained": axis.unexplained,
        "held_out": axis.held_out,
        "band_hz": [0.0, axis.band_hz],
        "usable": axis.answer.is_usable,
    }
