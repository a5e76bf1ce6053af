"""The report of a diagnosis: one page a machine builder understands."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sgms_observer.diagnosis.advice import Named
from sgms_observer.diagnosis.answer import Answer
from sgms_observer.diagnosis.closing import Closing
from sgms_observer.diagnosis.learnt import Learnt
from sgms_observer.diagnosis.locate import Located
from sgms_observer.diagnosis.workflow import Options
from sgms_observer.effects.catalogue import effect
from sgms_observer.report.drawing import ESTIMATE, MEASURED, REFERENCE, sheet
from sgms_observer.report.page import Picture, Section, Table, write_page
from sgms_observer.settings.axis import AxisSettings
from sgms_observer.settings.units import Units

NINETY = 1.645


def write_report(
    answer: Answer,
    axis: AxisSettings,
    closings: Sequence[Closing],
    options: Options,
    out: Path,
    names: Sequence[str],
    notes: Sequence[str],
) -> Path:
    """Write report.html with its pictures.

    Args:
        answer: the answer.
        axis: settings with the model as it was given.
        closings: observer and compensation before and after.
        options: as it was run.
        out: folder.
        names: recordings.
        notes: sentences about how the recordings were read.
    """
    units = axis.units
    sections = [
        *_warnings(answer),
        _gap(answer),
        _where(answer, units),
        _what(answer, units),
        _before_and_after(answer, closings, units),
        _not_shown(answer),
        _next(answer),
        _decisions(answer, options, notes),
    ]
    source = f"From {', '.join(Path(name).name for name in names)}; seed {options.seed}."
    return write_page(out, f"Diagnosis of axis {axis.name}", sentence(answer), sections, source)


def sentence(answer: Answer) -> str:
    """Return the verdict in one sentence."""
    gap = answer.gap
    shrink = f"the gap on {gap.held_out} data falls from {gap.before:.3g} % to {gap.after:.3g} % of the rms effort"
    names = _listed(answer)
    match answer.verdict:
        case "effect_found":
            those = "it" if len(answer.effects) == 1 else "them"
            return f"The model misses {names}: with {those}, {shrink}."
        case "ambiguous":
            doubts = " and ".join(
                f"{item.settings.name} from {' or '.join(item.alternatives)}".replace("_", " ")
                for item in answer.effects
                if item.alternatives
            )
            return f"The model misses something like {names}, but these recordings cannot tell {doubts}; {shrink}."
        case "unknown_effect":
            where = f", most visibly over {answer.located[0].coordinate}" if answer.located else ""
            maps = [f" It looks like {item.sentence}; a learnt map of it was added." for item in answer.learnt]
            learnt = "".join(maps)
            return f"The model misses something that has no name in the catalogue{where}.{learnt}"
        case "cannot_tell":
            return "These recordings cannot show whether the model misses anything."
        case _:
            return (
                f"Nothing is missing that these recordings could show; the gap is {gap.after:.3g} % of the rms effort."
            )


def _warnings(answer: Answer) -> list[Section]:
    """Return the section of warnings, if there are any."""
    return [Section("Warnings", [f"Warning: {text}." for text in answer.warnings])] if answer.warnings else []


def _gap(answer: Answer) -> Section:
    """Return the section on the gap in its three parts, with the bar after each effect."""
    gap = answer.gap
    low, high = gap.interval_before
    text = [
        f"Gap: measured minus predicted effort below {gap.band:.4g} Hz on {gap.held_out} data, rms, in % of the rms"
        f" measured effort. As the file was given {gap.given:.3g} %; refitted within its tolerance {gap.before:.3g} %"
        f" (90 % interval {low:.3g} to {high:.3g} %).",
    ]
    closure = "nothing to close" if gap.closure is None else f"{100.0 * gap.closure:.0f} %"
    rows = [
        ("named", f"{gap.named:.3g} %", "closed by the effects and changed values below"),
        ("predictable, without a name", f"{gap.predictable:.3g} %", "a free-form regression predicts it"),
        ("not predictable", f"{gap.floor:.3g} %", "noise, encoder, and what nothing recorded here predicts"),
        ("closure", closure, "(before - after) / (before - not predictable)"),
    ]
    changed = [
        (item.name, _number(item.before), _number(item.after), f"{item.std_error:.2g}", f"{100.0 * item.closes:.0f} %")
        for item in answer.changed
    ]
    tables = [Table(("part", "size", "meaning"), rows, "The gap: squares of the parts add up")]
    if changed:
        header = ("value of the file", "in the file", "in the recordings", "standard error", "closes together")
        tables.append(Table(header, changed, "Values of the file that moved beyond their tolerance"))
    return Section("How well the model predicts", text, tables, [_bars(answer)])


def _number(value: float | str) -> str:
    """Return a value of the file for people."""
    return value if isinstance(value, str) else f"{value:.4g}"


def _bars(answer: Answer) -> Picture:
    """Draw the gap as given, refitted, after each effect and after what was learnt, down to the floor."""
    gap = answer.gap
    steps = [("file as given", gap.given), ("refitted", gap.before)]
    steps += [(f"with {item.settings.name}", item.gap_after) for item in answer.effects if np.isfinite(item.gap_after)]
    if not answer.effects and gap.after < gap.before:
        steps.append(("with changed values", gap.after))
    if answer.learnt:
        steps.append(("with learnt map", answer.gap_with_learnt))
    caption = "Gap after each step; the line is what nothing recorded here predicts."
    with sheet("gap", caption, height=0.5 + 0.4 * len(steps)) as drawn:
        axes = drawn.axes[0]
        names, sizes = [name for name, _ in steps][::-1], [size for _, size in steps][::-1]
        axes.barh(names, sizes, color=ESTIMATE)
        axes.axvline(gap.floor, color=MEASURED, lw=1.2, ls="--", label="not predictable")
        axes.set_xlabel("gap [% of rms effort]")
        axes.legend(loc="lower right")
    assert drawn.picture is not None
    return drawn.picture


def _listed(answer: Answer) -> str:
    """Return the effects' names as a person would list them."""
    names = [item.settings.name.replace("_", " ") for item in answer.effects]
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def _what(answer: Answer, units: Units) -> Section:
    """Return the section on the effects."""
    text, tables = [], []
    for item in answer.effects:
        entry = effect(item.settings.name)
        text.append(
            f"{entry.name}: {entry.equation}. It acts on {entry.place.value}. Shows as: {entry.signature}. "
            f"Confidence {item.confidence:.2f}."
        )
        header = ("parameter", "value", "90 % interval", "unit")
        tables.append(Table(header, _parameter_rows(item, units), entry.name))
    for learnt in answer.learnt:
        text.append(f"Learnt: {learnt.sentence}. It closes {100.0 * learnt.share:.0f} % of the squared rest.")
    pictures = [_learnt(learnt, units) for learnt in answer.learnt]
    return Section("What", text or ["No effect was added to the model."], [*tables, *_tests(answer)], pictures)


def _learnt(learnt: Learnt, units: Units) -> Picture:
    """Draw a learnt map."""
    table = learnt.map.table()
    both = zip(learnt.map.coordinates, learnt.map.grids, strict=True)
    gridded = [(key, grid) for key, grid in both if key != "direction"]
    key, grid = gridded[0]
    with sheet(learnt.map.name, f"Learnt map: {learnt.sentence}.", height=2.6) as drawn:
        axes = drawn.axes[0]
        columns = table.reshape(len(grid), -1)
        if "direction" in learnt.map.coordinates:
            labels = ["backward", "forward"]
        elif len(gridded) == 1:
            labels = ["both directions"]
        else:
            labels = [f"{gridded[1][0]} {value:.3g}" for value in gridded[1][1]]
        for column, label in zip(columns.T, labels, strict=True):
            axes.plot(grid, column, "o-", ms=3, label=label)
        axes.set_xlabel(key)
        axes.set_ylabel(f"{units.effort_word} [{units.effort}]")
        axes.legend()
    assert drawn.picture is not None
    return drawn.picture


def _parameter_rows(item: Named, units: Units) -> list[tuple[str, str, str, str]]:
    """Return the table rows of one effect's parameters."""
    entry = effect(item.settings.name)
    rows = []
    for parameter, value, error in zip(entry.parameters, item.settings.values, item.std_error, strict=True):
        low, high = value - NINETY * error, value + NINETY * error
        interval = f"{low:.4g} .. {high:.4g}" if error > 0.0 else "fixed"
        rows.append((parameter.name, f"{value:.5g}", interval, units.of(parameter.unit)))
    return rows


def _tests(answer: Answer) -> list[Table]:
    """Return every hypothesis that was fitted fully, with its tests: value, threshold and outcome."""
    tables = []
    for number, step in enumerate(answer.diagnosis.rounds, 1):
        rows = []
        for item in step.decisions:
            name = item.candidate.name
            if step.accepted is not None and name == step.accepted.candidate.name:
                outcome = "added"
            elif name in step.alternatives:
                outcome = "not told from the added one"
            else:
                outcome = "not added"
            for test in item.tests:
                mark = "passed" if test.passed else "failed"
                rows.append((name, outcome, test.name, f"{test.value:.3g}", f"{test.threshold:.3g}", mark))
                name = outcome = ""
        if rows:
            header = ("hypothesis", "outcome", "test", "value", "threshold", "")
            tables.append(Table(header, rows, f"Round {number}: hypotheses fitted fully, the best predicting first"))
    return tables


def _where(answer: Answer, units: Units) -> Section:
    """Return the section on where the nominal model disagrees."""
    if not answer.located:
        text = "The nominal model's residual depends on nothing beyond chance."
        return Section("Where", [text], [], [_map(answer, units)])
    rows = [
        (
            item.coordinate,
            f"{item.low:.3g} .. {item.high:.3g} {units.of(item.unit)}",
            f"{100 * item.share:.0f} %",
            f"{item.p_value:.3f}",
        )
        for item in answer.located
    ]
    header = ("coordinate", "largest between", "share of the slow residual", "p")
    text = "Residual of the nominal model, its parameters refitted."
    return Section("Where", [text], [Table(header, rows)], [_map(answer, units)])


def _map(answer: Answer, units: Units) -> Picture:
    """Draw the residual over the coordinates that tell most, always with position, velocity and time."""
    wanted = ["position", "velocity", "time"]
    listed: list[Located] = [item for name in wanted for item in answer.all_located if item.coordinate == name]
    listed += [item for item in answer.all_located if item not in listed][: 6 - len(listed)]
    caption = "Mean residual per bin, with the band in which chance would leave it (95 %)."
    with sheet("where", caption, rows=(len(listed) + 1) // 2, columns=2, height=2.6) as drawn:
        for axes, item in zip(drawn.axes, listed, strict=False):
            middle = float(np.mean(item.mean))
            axes.fill_between(
                item.centres, middle - item.band, middle + item.band, color=REFERENCE, alpha=0.35, label="chance"
            )
            axes.plot(item.centres, item.mean, "o-", color=ESTIMATE, ms=3, label="residual")
            axes.locator_params(axis="x", nbins=5)
            axes.set_xlabel(f"{item.coordinate} [{units.of(item.unit)}]")
            axes.set_ylabel(f"residual [{units.effort}]")
        drawn.axes[0].legend()
        for axes in drawn.axes[len(listed) :]:
            axes.set_visible(False)
    assert drawn.picture is not None
    return drawn.picture


def _before_and_after(answer: Answer, closings: Sequence[Closing], units: Units) -> Section:
    """Return the section on held-out data, observer and compensation."""
    gap = answer.gap
    low, high = gap.interval_after
    text = [f"With what was named the gap is {gap.after:.3g} % (90 % interval {low:.3g} to {high:.3g} %)."]
    rows = [
        (
            f"observer: measured minus predicted friction [{units.effort} rms]",
            *(f"{item.innovation:.4g}" for item in closings),
        ),
        (
            f"friction not cancelled by the feedforward [{units.effort} rms]",
            *(f"{item.compensation:.4g}" for item in closings),
        ),
    ]
    table = Table(("with the model", "as it was given", "augmented"), rows)
    pictures = [_residuals(answer, units)]
    if answer.located_after:
        pictures.append(_map_before_and_after(answer, units))
    return Section("Before and after", text, [table], pictures)


def _map_before_and_after(answer: Answer, units: Units) -> Picture:
    """Draw the residual over the coordinates that showed it most, without and with what was added."""
    caption = f"Mean residual per bin on {answer.gap.held_out} data, before and after."
    pairs = list(zip(answer.located, answer.located_after, strict=True))
    with sheet("where_after", caption, rows=(len(pairs) + 1) // 2, columns=2, height=2.6) as drawn:
        for axes, (before, after) in zip(drawn.axes, pairs, strict=False):
            axes.fill_between(after.centres, -after.band, after.band, color=REFERENCE, alpha=0.35, label="chance")
            axes.plot(before.centres, before.mean, "o-", color=REFERENCE, ms=3, label="before")
            axes.plot(after.centres, after.mean, "o-", color=ESTIMATE, ms=3, label="after")
            axes.locator_params(axis="x", nbins=5)
            axes.set_xlabel(f"{before.coordinate} [{units.of(before.unit)}]")
            axes.set_ylabel(f"residual [{units.effort}]")
        drawn.axes[0].legend()
        for axes in drawn.axes[len(pairs) :]:
            axes.set_visible(False)
    assert drawn.picture is not None
    return drawn.picture


def _residuals(answer: Answer, units: Units) -> Picture:
    """Draw residuals over time before and after."""
    gap = answer.gap
    with sheet("before_and_after", f"Residual on {gap.held_out} data.", rows=2, height=2.4, sharex=True) as drawn:
        start = 0.0
        for motion, one, other in zip(answer.motions, answer.residual_before, answer.residual_after, strict=True):
            time = start + motion.thinned(motion.time) - float(motion.time[0])
            drawn.axes[0].plot(time, one, color=REFERENCE, lw=0.7, label="before" if start == 0.0 else None)
            drawn.axes[0].plot(time, other, color=ESTIMATE, lw=0.7, label="after" if start == 0.0 else None)
            drawn.axes[1].plot(time, motion.thinned(motion.velocity), color=MEASURED, lw=0.8)
            start += float(motion.time[-1] - motion.time[0])
        drawn.axes[0].set_ylabel(f"residual [{units.effort}]")
        drawn.axes[0].legend(loc="upper right")
        drawn.axes[1].set_ylabel(f"velocity [{units.velocity}]")
        drawn.axes[1].set_xlabel("time [s]")
    assert drawn.picture is not None
    return drawn.picture


def _not_shown(answer: Answer) -> Section:
    """Return the section on what could not have been seen."""
    rows = [
        (name, f"{100 * size:.1f} %", effect(name).excitation)
        for name, size in sorted(answer.detectable.items(), key=lambda x: x[1])
    ]
    header = ("effect", "smallest size seen (share of Coulomb force)", "shown best by")
    return Section(
        "What these recordings could not show",
        ["Smaller effects than these would have passed for noise, or for nominal parameters that are slightly off."],
        [Table(header, rows)],
    )


def _next(answer: Answer) -> Section:
    """Return the section on the next experiment."""
    nothing = "Nothing: load augmented.yaml into the nodes." if answer.usable else "Identify the axis first."
    return Section("What to run next", [answer.next_experiment or nothing])


def _decisions(answer: Answer, options: Options, notes: Sequence[str]) -> Section:
    """Return the section with what the run read and how far the values of the file moved."""
    found = answer.diagnosis
    text = [*notes, *found.notes]
    for item in found.court.judged.noise:
        text.append(f"Noise below the band {item.rms:.3g} rms, corner {item.corner:.0f} Hz.")
    text.append(f"Tolerance of the values of the file {100 * options.tolerance:.0f} %.")
    names = found.before.model.parameter_names()
    rows = [(name, f"{100 * (np.exp(one) - 1):+.2f} %") for name, one in zip(names, found.before.logs, strict=True)]
    tables = [Table(("parameter", "refit within the tolerance"), rows, "Change against the file")]
    if found.rounds:
        looks = sorted(found.rounds[0].looks.items(), key=lambda item: -item[1].gain)
        first = [(name, f"{look.gain:.0f}", f"{look.trials}") for name, look in looks]
        header = ("effect", "chi2_reduction", "shapes tried")
        tables.append(Table(header, first, "First look: decrease of the whitened squared residual"))
    return Section("Everything the run decided", text, tables)
