"""The summary of many recordings: summary.json and one page."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from sgms_observer.fleet.jobs import Outcome
from sgms_observer.report.page import Page, Section, Table, write_page
from sgms_observer.status import MAX_NIS
from sgms_observer.whole_file import write_text

SUMMARY = "summary.json"


def summary_of(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """Return what summary.json and ``--json`` say.

    Args:
        outcomes: of all jobs, in their order.
    """
    return {"schema": 1, "recordings": [{"name": o.name, "fault": o.fault or None, **o.figures} for o in outcomes]}


def write_summary(
    title: str, outcomes: Sequence[Outcome], folder: Path, config: str, *, has_page: bool = True
) -> Path | None:
    """Write summary.json and report.html: the same bytes for the same outcomes.

    Args:
        title: heading of the page.
        outcomes: of all jobs, in their order.
        folder: where to.
        config: parameter file, for the page's footer.
        has_page: write report.html.

    Returns:
        Path of the page; None without one.

    Raises:
        RecordingError: the folder cannot be written.
    """
    write_text(json.dumps(summary_of(outcomes), indent=1) + "\n", folder / SUMMARY)
    if not has_page:
        return None
    good = [outcome for outcome in outcomes if not outcome.fault]
    is_diagnosis = any("verdict" in outcome.figures for outcome in good)
    sections = [_diagnoses(good) if is_diagnosis else _replays(good)] if good else []
    faults = [(outcome.name, outcome.fault) for outcome in outcomes if outcome.fault]
    if faults:
        table = Table(("recording", "what is wrong"), faults, "Recordings that gave no result")
        sections.append(Section("Left out", [f"{len(faults)} of {len(outcomes)} recordings gave no result."], [table]))
    page = Page(title, verdict(outcomes), sections, f"With the parameters of {Path(config).name}.")
    return write_page(page, folder)


def verdict(outcomes: Sequence[Outcome]) -> str:
    """Return the whole in one sentence.

    Args:
        outcomes: of all jobs.
    """
    good = [outcome for outcome in outcomes if not outcome.fault]
    start = f"{len(good)} of {len(outcomes)} recordings gave a result"
    verdicts = Counter(outcome.figures["verdict"] for outcome in good if "verdict" in outcome.figures)
    if verdicts:
        counts = ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in sorted(verdicts.items()))
        unusable = sum(not outcome.figures["usable"] for outcome in good)
        caution = f" The result of {unusable} must not be used as it is." if unusable else ""
        return f"{start}: {counts}.{caution}"
    axes = [list(outcome.figures.get("axes", {}).values()) for outcome in good]
    high = sum(any(axis["corrections"] and _nis(axis) > MAX_NIS for axis in some) for some in axes)
    blind = sum(any(not axis["corrections"] for axis in some) for some in axes)
    parts = [start]
    if high:
        parts.append(f"the model fits badly (NIS above {MAX_NIS:g}) in {high} of them")
    if blind:
        parts.append(f"the observer made no correction in {blind} of them")
    if len(parts) > 1:
        return f"{'; '.join(parts)}."
    return f"{start}; the model fits all of them." if good else f"{start}."


def _replays(outcomes: Sequence[Outcome]) -> Section:
    """Return what replay says of each recording and axis, the worst fit first."""
    rows = []
    for outcome in outcomes:
        for name, axis in outcome.figures["axes"].items():
            rows.append((_nis(axis), outcome, name, axis))
    rows.sort(key=lambda row: -row[0])
    header = (
        "recording",
        "axis",
        "duration [s]",
        "samples",
        "innovation, rms",
        "NIS",
        "samples in trouble",
        "warnings",
    )
    table = Table(header, [_replay_row(outcome, name, axis) for _, outcome, name, axis in rows],
                  "The worst fit first; an NIS far above 1 means a model that misses something")  # fmt: skip
    text = "The observer ran over every recording with the same parameters. Each new bag lies beside this page."
    return Section("Recordings", [text], [table])


def _nis(axis: Mapping[str, Any]) -> float:
    """Return the NIS of an axis; what is not a number fits worst."""
    return math.inf if axis["nis"] is None else float(axis["nis"])


def _replay_row(outcome: Outcome, name: str, axis: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the row of an axis of a recording."""
    return (
        outcome.name,
        name,
        f"{outcome.figures['duration']:.1f}",
        f"{axis['samples']}",
        "-" if axis["innovation"] is None else f"{axis['innovation']:.4g} {axis['unit']}",
        f"{_nis(axis):.3g}",
        f"{axis['in_trouble']}",
        "; ".join(outcome.figures["warnings"]),
    )


def _diagnoses(outcomes: Sequence[Outcome]) -> Section:
    """Return what was found in each recording, the largest gap first."""
    ranked = sorted(outcomes, key=lambda outcome: -float(outcome.figures["gap"]["before"]))
    rows = []
    for outcome in ranked:
        gap = outcome.figures["gap"]
        effects = [_effect(found) for found in outcome.figures["effects"]]
        rows.append(
            (
                outcome.name,
                outcome.figures["verdict"].replace("_", " "),
                "; ".join(effects) or "-",
                f"{gap['before']:.3g}",
                f"{gap['after']:.3g}",
                f"{gap['floor']:.3g}",
                "yes" if outcome.figures["usable"] else "no",
                outcome.figures["next_experiment"] or "-",
            )
        )
    header = ("recording", "verdict", "effects", "gap before", "gap after", "noise floor", "usable", "next")
    table = Table(header, rows, "The largest gap first; gaps in % of the rms effort")
    text = "Each recording was diagnosed by itself; its own report lies in the folder of its name beside this page."
    return Section("Recordings", [text], [table])


def _effect(found: Mapping[str, Any]) -> str:
    """Return an effect with its values."""
    values = ", ".join(
        f"{name} {'not determined' if name in found['undetermined'] else f'{value:.4g}'}"
        for name, value in found["parameters"].items()
    )
    return f"{found['name'].replace('_', ' ')} ({values})"
