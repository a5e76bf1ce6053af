"""One recording's job, as a function of plain data that any process can run, and what became of it."""

from __future__ import annotations

import math
import os
import traceback
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from sgms_observer.errors import SgmsError
from sgms_observer.outcome import SHOW_TRACEBACK


@dataclass(frozen=True)
class ReplayJob:
    """The observer over one recording.

    Attributes:
        name: name of the job in the summary, and of its folder.
        bag: the recording.
        config: parameter file.
        out: folder of the new bag.
        storage: ``mcap`` or ``sqlite3``.
        topics: names of the input topics where they differ.
        is_overwriting: replace what is in the folder: a cluster starts a job again whose worker it lost.
    """

    name: str
    bag: str
    config: str
    out: str
    storage: str
    topics: Mapping[str, str] = field(default_factory=dict)
    is_overwriting: bool = False


@dataclass(frozen=True)
class DiagnoseJob:
    """The diagnosis of one recording.

    Attributes:
        name: name of the job in the summary, and of its folder.
        bag: the recording to learn from.
        holdout: recordings to judge on.
        config: parameter file.
        out: folder of result.json, augmented.yaml and report.html.
        axis: axis to diagnose; the first of the YAML if None.
        tolerance: how far the YAML's mass and friction may be off, as a share.
        seed: of every random number.
    """

    name: str
    bag: str
    holdout: tuple[str, ...]
    config: str
    out: str
    axis: str | None
    tolerance: float
    seed: int


@dataclass(frozen=True)
class Outcome:
    """What became of a job.

    Attributes:
        name: name of the job.
        fault: what went wrong, in a sentence; empty if all went well.
        figures: what the summary tells of it, plain data for JSON.
    """

    name: str
    fault: str = ""
    figures: Mapping[str, Any] = field(default_factory=dict)


def run_job(job: ReplayJob | DiagnoseJob) -> Outcome:
    """Do a job; whatever goes wrong becomes a sentence, so that the other jobs go on.

    Args:
        job: what is to be done.
    """
    try:
        figures = _replay(job) if isinstance(job, ReplayJob) else _diagnose(job)
        return Outcome(job.name, "", figures)
    except SgmsError as error:
        return Outcome(job.name, "; ".join(str(error).splitlines()))
    except OSError as error:
        return Outcome(job.name, f"{error.filename or job.bag}: {error.strerror or error}")
    except Exception as error:
        if os.environ.get(SHOW_TRACEBACK):
            traceback.print_exc()
        text = " ".join(str(error).split())
        return Outcome(job.name, f"a fault of this package, {type(error).__name__}: {text}; report it")


def _replay(job: ReplayJob) -> dict[str, Any]:
    """Replay a recording and return its figures."""
    from sgms_observer.application.replay import replay_bag

    done = replay_bag(
        job.bag, job.config, job.out, job.storage, job.topics, lambda share: None, is_overwriting=job.is_overwriting
    )
    return {
        "duration": done.duration,
        "messages": done.messages,
        "axes": {name: {**_plain(tally.figures()), "unit": tally.unit} for name, tally in done.tallies.items()},
        "notes": list(done.warnings),
    }


def _plain(figures: Mapping[str, float]) -> dict[str, float | None]:
    """Return figures for JSON, which knows no infinity."""
    return {name: value if math.isfinite(value) else None for name, value in figures.items()}


def _diagnose(job: DiagnoseJob) -> dict[str, Any]:
    """Diagnose a recording and return what result.json says."""
    import json

    from sgms_observer.application.diagnose import DiagnoseRequest, diagnose_bags

    diagnose_bags(
        DiagnoseRequest([job.bag], job.config, job.out, job.holdout, job.axis, tolerance=job.tolerance, seed=job.seed)
    )
    result: dict[str, Any] = json.loads((Path(job.out) / "result.json").read_text(encoding="utf-8"))
    return {key: result[key] for key in ("verdict", "gap", "effects", "next_experiment")}


def job_names(bags: list[str]) -> list[str]:
    """Return a name for each recording: its own, with a number behind it where several are called the same.

    Args:
        bags: the recordings, in the order of the command line.
    """
    names: list[str] = []
    for bag in bags:
        path = Path(bag)
        stem = path.stem if path.suffix in (".mcap", ".db3") else path.name
        stem = stem or path.resolve().name or "bag"
        name, number = stem, 2
        while name in names:
            name, number = f"{stem}-{number}", number + 1
        names.append(name)
    return names
