"""The report of a diagnosis: one page a machine builder understands."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sgms_observer.diagnosis.advice import Named
from sgms_observer.diagnosis.answer import Answer
from sgms_observer.diagnosis.closing import Closing
from sgms_observer.diagnosis.decide import CLOSES
from sgms_observer.diagnosis.locate import Located
from sgms_observer.diagnosis.tolerance import Deviation
from sgms_observer.diagnosis.workflow import Options
from sgms_observer.effects.catalogue import effect
from sgms_observer.report.drawing import ESTIMATE, MEASURED, REFERENCE, sheet
from sgms_observer.report.page import Picture, Section, Table, write_page
from sgms_observer.settings.axis import AxisSettings

NINETY = 1.645


def write_report(
    answer: Answer, axis: AxisSettings, closings: Sequence[Closing], options: Options, out: Path, names: Sequence[str]
) -> Path:
    """Write report.html with its pictures.

    Args:
        answer: the answer.
        axis: settings with the model as it was given.
        closings: observer and compensation before and after.
        options: as it was run.
        out: folder.
        names: recordings.
    """
    sections = [
        _where(answer),
        _what(answer),
        _before_and_after(answer, closings),
        _not_shown(answer),
        _next(answer),
        _decisions(answer, options),
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
            return f"The model misses something that is not in the catalogue{where}; nothing was added."
        case "cannot_tell":
            return "These recordings are too poor in motion to say whether the model misses anything."
        case _:
            return (
                f"Nothing is missing that these recordings could show; the gap is {gap.before:.3g} % of the rms effort."
            )


def _listed(answer: Answer) -> str:
    """Return the effects' names as a person would list them."""
    names = [item.settings.name.replace("_", " ") for item in answer.effects]
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def _what(answer: Answer) -> Section:
    """Return the section on the effects."""
    if not answer.effects:
        return Section("What", ["No effect was added to the model."])
    text, tables = [], []
    for item in answer.effects:
        entry = effect(item.settings.name)
        text.append(
            f"{entry.name}: {entry.equation}. It acts on {entry.place.value}. Shows as: {entry.signature}. "
            f"Confidence {item.confidence:.2f}."
        )
        tables.append(Table(("parameter", "value", "90 % interval", "unit"), _parameter_rows(item), entry.name))
    return Section("What", text, [*tables, *_alternatives(answer)])


def _parameter_rows(item: Named) -> list[tuple[str, str, str, str]]:
    """Return the table rows of one effect's parameters."""
    entry = effect(item.settings.name)
    rows = []
    for parameter, value, error in zip(entry.parameters, item.settings.values, item.std_error, strict=True):
        low, high = value - NINETY * error, value + NINETY * error
        interval = f"{low:.4g} .. {high:.4g}" if error > 0.0 else "fixed"
        rows.append((parameter.name, f"{value:.5g}", interval, parameter.unit))
    return rows


def _alternatives(answer: Answer) -> list[Table]:
    """Return what else was fitted, and why not."""
    tables = []
    for number, step in enumerate(answer.diagnosis.rounds, 1):
        if not step.listed:
            continue
        best = step.listed[0].taken
        rows = []
        for item in step.listed:
            if item.name == step.listed[0].name:
                why = (
                    "taken" if step.accepted else "not taken: it explains too little, or only the first effect's shape"
                )
            elif item.name in step.alternatives:
                why = "cannot be told from the first"
            else:
                why = f"explains {100.0 * max(item.taken, 0.0) / max(best, 1e-9):.0f} % of what the first does"
            limits = f" ({', '.join(item.at_bound)} at its physical limit)" if item.at_bound else ""
            rows.append((item.name, f"{item.taken:.0f}", why + limits))
        header = ("effect", "squared residual it takes (noise units)", "why (not)")
        tables.append(Table(header, rows, f"Round {number}: effects fitted fully"))
    return tables


def _where(answer: Answer) -> Section:
    """Return the section on where the nominal model disagrees."""
    if not answer.located:
        return Section("Where", ["The nominal model's residual depends on nothing beyond chance."], [], [_map(answer)])
    rows = [
        (
            item.coordinate,
            f"{item.low:.3g} .. {item.high:.3g} {item.unit}",
            f"{100 * item.share:.0f} %",
            f"{item.p_value:.3f}",
        )
        for item in answer.located
    ]
    header = ("coordinate", "largest between", "share of the slow residual", "p")
    return Section(
        "Where", ["Residual of the nominal model, its parameters refitted."], [Table(header, rows)], [_map(answer)]
    )


def _map(answer: Answer) -> Picture:
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
            axes.set_xlabel(f"{item.coordinate} [{item.unit}]")
            axes.set_ylabel("residual [N]")
        drawn.axes[0].legend()
        for axes in drawn.axes[len(listed) :]:
            axes.set_visible(False)
    assert drawn.picture is not None
    return drawn.picture


def _before_and_after(answer: Answer, closings: Sequence[Closing]) -> Section:
    """Return the section on held-out data, observer and compensation."""
    gap = answer.gap
    low, high = gap.interval_after
    text = [
        f"On {gap.held_out} data the gap is {gap.before:.3g} % of the rms effort before and {gap.after:.3g} % "
        f"after (90 % interval {low:.3g} .. {high:.3g} %); noise alone is about {gap.floor:.3g} %."
    ]
    rows = [
        ("observer: measured minus predicted friction [N rms]", *(f"{item.innovation:.4g}" for item in closings)),
        ("left after compensation [N rms]", *(f"{item.compensation:.4g}" for item in closings)),
    ]
    table = Table(("with the model", "as it was given", "augmented"), rows)
    pictures = [_residuals(answer)]
    if answer.located_after:
        pictures.append(_map_before_and_after(answer))
    return Section("Before and after", text, [table], pictures)


def _map_before_and_after(answer: Answer) -> Picture:
    """Draw the residual over the coordinates that showed it most, without and with what was added."""
    names = _listed(answer)
    caption = f"Mean residual per bin on {answer.gap.held_out} data, as the model was and with {names}."
    pairs = list(zip(answer.located, answer.located_after, strict=True))
    with sheet("where_after", caption, rows=(len(pairs) + 1) // 2, columns=2, height=2.6) as drawn:
        for axes, (before, after) in zip(drawn.axes, pairs, strict=False):
            axes.fill_between(after.centres, -after.band, after.band, color=REFERENCE, alpha=0.35, label="chance")
            axes.plot(before.centres, before.mean, "o-", color=REFERENCE, ms=3, label="before")
            axes.plot(after.centres, after.mean, "o-", color=ESTIMATE, ms=3, label="after")
            axes.set_xlabel(f"{before.coordinate} [{before.unit}]")
            axes.set_ylabel("residual [N]")
        drawn.axes[0].legend()
        for axes in drawn.axes[len(pairs) :]:
            axes.set_visible(False)
    assert drawn.picture is not None
    return drawn.picture


def _residuals(answer: Answer) -> Picture:
    """Draw residuals over time before and after."""
    gap = answer.gap
    with sheet("before_and_after", f"Residual on {gap.held_out} data.", rows=2, height=2.4, sharex=True) as drawn:
        start = 0.0
        for motion, one, other in zip(gap.motions, gap.residual_before, gap.residual_after, strict=True):
            time = start + motion.thinned(motion.time) - float(motion.time[0])
            drawn.axes[0].plot(time, one, color=REFERENCE, lw=0.7, label="before" if start == 0.0 else None)
            drawn.axes[0].plot(time, other, color=ESTIMATE, lw=0.7, label="after" if start == 0.0 else None)
            drawn.axes[1].plot(time, motion.thinned(motion.velocity), color=MEASURED, lw=0.8)
            start += float(motion.time[-1] - motion.time[0])
        drawn.axes[0].set_ylabel("residual [N]")
        drawn.axes[0].legend(loc="upper right")
        drawn.axes[1].set_ylabel("velocity [m/s]")
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
    return Section("What to run next", [answer.next_experiment or "Nothing: load augmented.yaml into the nodes."])


def _decisions(answer: Answer, options: Options) -> Section:
    """Return the section with everything the run decided."""
    found = answer.diagnosis
    text = [*found.notes]
    for item in found.judged.noise:
        text.append(f"Noise below the band {item.rms:.3g} N rms, corner {item.corner:.0f} Hz.")
    text.append(
        f"{len(found.calibration.largest)} null twins (others set the scale): the largest standardised gain by chance "
        f"was {found.calibration.largest.max():.1f}. An effect is taken when it explains at least "
        f"{100 * CLOSES:.0f} % of what is more than noise. Owner's tolerance {100 * options.tolerance:.0f} %."
    )
    if isinstance(found.deviation, Deviation):
        text.append(f"The refitted parameters together say {found.deviation.name} = {found.deviation.value:.4g}.")
    names = found.nominal.parameter_names()
    rows = [
        (name, f"{100 * (np.exp(one) - 1):+.2f} %", f"{100 * (np.exp(other) - 1):+.2f} %")
        for name, one, other in zip(names, found.before.logs, found.after.logs, strict=True)
    ]
    table = Table(("parameter", "refit alone", "refit with effects"), rows, "Change against the YAML")
    scores = sorted(found.rounds[0].scores.items(), key=lambda item: -item[1])
    first = Table(("effect", "standardised gain"), [(n, f"{s:.1f}") for n, s in scores], "First look")
    return Section("Everything the run decided", text, [table, first])
