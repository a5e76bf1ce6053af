"""Pictures of a diagnosis's report."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.diagnosis.answer import Answer
from sgms_observer.diagnosis.locate import Located
from sgms_observer.diagnosis.map_fit import FittedMap
from sgms_observer.diagnosis.traces import Trace
from sgms_observer.diagnosis.tracking import PredictedTracking
from sgms_observer.effects.catalogue import effect
from sgms_observer.effects.compiled import CompiledEffects
from sgms_observer.effects.effect import EffectSettings, Place
from sgms_observer.report.drawing import (
    BACKWARD,
    ESTIMATE,
    FORWARD,
    MEASURED,
    REFERENCE,
    TRUTH,
    Line,
    Panel,
    one_after_another,
    sheet,
    time_plot,
    with_holes,
)
from sgms_observer.report.friction_pictures import (
    hysteresis,
    measured_against_modelled,
    over_velocity,
    residual_over_position,
    stribeck_points,
)
from sgms_observer.report.gap_picture import gap_picture
from sgms_observer.report.page import Picture, Plot
from sgms_observer.report.reversal_picture import presliding_distance, reversal_picture
from sgms_observer.settings.axis import FrictionSettings
from sgms_observer.settings.units import Units

_MAX_LOCATED = 6
_LARGEST_POINT = 36.0  # area of the point of a learnt map with most data [points^2]
_GRID_COLOURS = (FORWARD, BACKWARD, MEASURED, ESTIMATE, REFERENCE)


def gap_bar(answer: Answer) -> Picture:
    """Draw the gap of the given file, refitted, after each effect and after learnt maps, with the floor."""
    gap = answer.gap
    steps = [("file as given", gap.given), ("refitted", gap.before)]
    steps += [
        (f"with {item.settings.name.replace('_', ' ')}", item.gap_after)
        for item in answer.effects
        if np.isfinite(item.gap_after)
    ]
    if not answer.effects and gap.after < gap.before:
        steps.append(("with changed values", gap.after))
    if answer.learnt:
        steps.append(("with learnt map", answer.gap_with_learnt))
    return gap_picture(steps, gap.floor)


def effect_over_position(answer: Answer, traces: Sequence[Trace], units: Units) -> Picture:
    """Draw the residual of the model without the found effects over the position, and the fitted effects."""
    names = [item.settings.name for item in answer.effects if item.settings.name in traces[0].effects]
    names += [item.settings.name for item in answer.learnt]
    effects = {name: np.concatenate([one.effects[name] for one in traces]) for name in names}
    position, velocity = (_all(traces, lambda one: one.position), _all(traces, lambda one: one.velocity))
    settings = [item.settings for item in answer.effects]
    return effects_over_position(position, velocity, _all(traces, lambda one: one.residual), effects, settings, units)


def effects_over_position(
    position: Floats,
    velocity: Floats,
    residual: Floats,
    effects: Mapping[str, Floats],
    settings: Sequence[EffectSettings],
    units: Units,
) -> Picture:
    """Draw the residual of a model without some of its effects over the position, and these effects.

    Args:
        position, velocity: motion, shape (n,).
        residual: of the whole model, shape (n,).
        effects: effort of each effect that is left out, shape (n,).
        settings: the values of named effects.
        units: of the axis.
    """
    name = "residual_over_position"
    if not effects:
        caption = "Residual in even bins of the position, with its standard error, by direction."
        return residual_over_position(name, caption, position, velocity, residual, units)
    fitted = np.sum(list(effects.values()), axis=0)
    listed = ", ".join(name.replace("_", " ") for name in effects)
    caption = (
        f"Residual of the model without {listed}, in even bins of the position, with its standard error, by direction."
        " Lines: the fitted effect."
    )
    periods = [
        value
        for item in settings
        for parameter, value in zip(effect(item.name).parameters, item.values, strict=False)
        if parameter.name == "pitch"
    ]
    return residual_over_position(
        name, caption, position, velocity, residual + fitted, units, fitted, min(periods, default=None),
        force_over_position([item for item in settings if item.name in effects]),
    )  # fmt: skip


def force_over_position(settings: Sequence[EffectSettings]) -> Callable[[Floats], Floats] | None:
    """Return the force of the effects that are functions of the position alone, or None if none of them is.

    Args:
        settings: effects with their values.
    """
    entries = [(item, effect(item.name)) for item in settings]
    of_position = [
        item for item, entry in entries if entry.place is Place.ADDED_FORCE and entry.coordinates == ("position",)
    ]
    if not of_position:
        return None

    def force(position: Floats) -> Floats:
        zero = np.zeros(len(position))
        compiled = CompiledEffects(of_position, 1.0)
        return compiled.evaluate(position, zero, zero, zero, zero, zero, zero, compiled.initial_state())[0]

    return force


def measured_over_modelled(answer: Answer, traces: Sequence[Trace], units: Units) -> Picture:
    """Draw measured over modelled effort."""
    caption = f"Measured over modelled {units.effort_word} on {answer.gap.held_out} data, with all that was found."
    measured, modelled = _all(traces, lambda one: one.effort), _all(traces, lambda one: one.after)
    return measured_against_modelled("fit", caption, measured, modelled, 100.0 - answer.gap_with_learnt, units)


def friction_pictures(traces: Sequence[Trace], friction: FrictionSettings, units: Units) -> tuple[Picture, ...]:
    """Draw friction over velocity, over position, and at one reversal.

    Args:
        traces: model and measurement.
        friction: of the model, for the distance over which presliding shows.
        units: of the axis.
    """
    sliding = [trace.is_sliding for trace in traces]
    velocity = np.concatenate([one.velocity[rows] for one, rows in zip(traces, sliding, strict=True)])
    measured_there = np.concatenate([one.friction[rows] for one, rows in zip(traces, sliding, strict=True)])
    modelled = np.concatenate([one.modelled_friction[rows] for one, rows in zip(traces, sliding, strict=True)])
    centre, mean, _deviation = stribeck_points(velocity, modelled)
    curve = [(centre[side], mean[side]) for side in (centre < 0.0, centre > 0.0) if side.any()]
    word = units.effort_word
    sliding_caption = (
        f"Friction while sliding: measured {word} minus what mass and effects take. Points: mean and standard deviation"
        " in each range of velocity; line: the model's means in the same ranges."
    )
    loops = "The same friction of all rows over position: the loops that it draws, measured and modelled."
    position = with_holes([one.position for one in traces])
    measured = with_holes([one.friction for one in traces])
    model = with_holes([one.modelled_friction for one in traces])
    distance = presliding_distance(
        friction.element_stiffness, [friction.static_force * share for share in friction.element_fraction]
    )
    pieces = [(one.position, one.friction, one.modelled_friction) for one in traces]
    reversal = reversal_picture("reversal", pieces, distance, units)
    return (
        over_velocity("stribeck", sliding_caption, velocity, measured_there, curve, units),
        hysteresis("hysteresis", loops, position, measured, model, units),
        *([reversal] if reversal else []),
    )


def over_time(traces: Sequence[Trace], units: Units) -> Plot:
    """Return measured and modelled effort, residuals and motion over time, as a plot that zooms."""

    def line(label: str, values: Callable[[Trace], Floats], colour: str, factor: float = 1.0) -> Line:
        return Line(label, factor * with_holes([values(one) for one in traces]), colour)

    fastest = max(float(np.max(np.abs(one.velocity))) for one in traces)
    speed, speed_unit = units.prefixed(fastest, "m/s")
    panels = [
        Panel(
            f"{units.effort_word} [{units.effort}]",
            [line("measured", lambda one: one.effort, "measured"), line("modelled", lambda one: one.after, "estimate")],
        ),
        Panel(
            f"residual [{units.effort}]",
            [
                line("before", lambda one: one.residual_before, "reference"),
                line("after", lambda one: one.residual, "estimate"),
            ],
        ),
        Panel(f"velocity [{speed_unit}]", [line("velocity", lambda one: one.velocity, "ink", speed)]),
    ]
    errors = np.concatenate([one.tracking_error for one in traces])
    known = np.abs(errors[np.isfinite(errors)])
    if known.size:
        factor, unit = units.prefixed(float(known.max()))
        tracking = line("position - set-point", lambda one: one.tracking_error, "forward", factor)
        panels.append(Panel(f"tracking error [{unit}]", [tracking]))
    several = " The recordings follow one another." if len(traces) > 1 else ""
    caption = f"Measured and modelled {units.effort_word}, residual and motion over time.{several}"
    return time_plot("over_time", caption, one_after_another([one.time for one in traces]), panels)


def tracking_plot(tracking: PredictedTracking, units: Units) -> Plot:
    """Return the tracking errors with and without compensation over time, as a plot that zooms."""
    factor, unit = units.prefixed(max(float(np.max(np.abs(error))) for error in tracking.errors))
    named = (
        ("without compensation", "measured"), ("with the file as given", "forward"),
        ("with augmented.yaml", "estimate"), ("recorded", "reference"),
    )  # fmt: skip
    lines = [
        Line(label, factor * error, colour) for (label, colour), error in zip(named, tracking.errors, strict=False)
    ]
    recorded = [line for line in lines if line.label == "recorded"]
    simulated = [line for line in lines if line not in recorded]
    panels = [Panel(f"predicted [{unit}]", simulated)]
    if recorded:
        panels.append(Panel(f"recorded [{unit}]", recorded))
    caption = f"Tracking error along {tracking.along}: predicted without and with compensation, and recorded."
    if not recorded:
        caption = f"Tracking error along {tracking.along}: predicted without and with compensation."
    return time_plot("tracking", caption, tracking.time, panels)


def map_picture(learnt: FittedMap, units: Units) -> Picture:
    """Draw a learnt map.

    A formula may part from it where it was learnt from few data. So the area of a point is inverse to the standard
    error that its own data would leave.
    """
    table = learnt.map.table()
    both = zip(learnt.map.coordinates, learnt.map.grids, strict=True)
    gridded = [(key, grid) for key, grid in both if key != "direction"]
    key, grid = gridded[0]
    listed = {item.name: item.unit for item in effect(learnt.map.name).lists}
    factor, unit = units.prefixed(float(np.max(np.abs(grid))), units.of(listed[key]))
    with sheet(learnt.map.name, f"Learnt map: {learnt.sentence}. Larger points: more data.") as drawn:
        axes = drawn.axes[0]
        columns, shares = (values.reshape(len(grid), -1) for values in (table, learnt.data_shares))
        colours: Sequence[str] = _GRID_COLOURS
        if "direction" in learnt.map.coordinates:
            labels, colours = ["backward", "forward"], (BACKWARD, FORWARD)
        elif len(gridded) == 1:
            labels = ["both directions"]
        else:
            labels = [f"{gridded[1][0]} {value:.3g}" for value in gridded[1][1]]
        for number, (column, share, label) in enumerate(zip(columns.T, shares.T, labels, strict=True)):
            colour, places = colours[number % len(colours)], factor * np.asarray(grid)
            axes.plot(places, column, label=label, color=colour)
            axes.scatter(places, column, _LARGEST_POINT * np.sqrt(share), color=colour)
        if learnt.formula:
            for number, column in enumerate(learnt.formula.map.table().reshape(len(grid), -1).T):
                axes.plot(factor * np.asarray(grid), column, "--", color=TRUTH, label=None if number else "formula")
        axes.set_xlabel(f"{key} [{unit}]")
        axes.set_ylabel(f"{units.effort_word} [{units.effort}]")
    return drawn.picture


def located_pictures(answer: Answer, units: Units) -> tuple[Picture, ...]:
    """Draw the residual before and after over position, velocity, time and the most significant coordinates."""
    wanted = ["position", "velocity", "time"]
    listed: list[Located] = [item for name in wanted for item in answer.all_located if item.coordinate == name]
    listed += [item for item in answer.all_located if item not in listed][: _MAX_LOCATED - len(listed)]
    later = {item.coordinate: item for item in answer.located_after}
    pictures = []
    for item in listed:
        caption = f"Mean residual over {item.coordinate}; grey: where chance would leave it."
        with sheet(f"where_{item.coordinate}", caption, height=2.4) as drawn:
            axes = drawn.axes[0]
            middle = float(np.mean(item.mean))
            factor, unit = units.prefixed(float(np.max(np.abs(item.centres))), item.unit)
            places = factor * item.centres
            axes.fill_between(
                places, middle - item.band, middle + item.band, color=REFERENCE, alpha=0.35, label="chance"
            )
            axes.plot(places, item.mean, "o-", color=MEASURED, ms=3, label="before")
            if item.coordinate in later:
                after = later[item.coordinate]
                axes.plot(factor * after.centres, after.mean, "o-", color=ESTIMATE, ms=3, label="after")
            axes.locator_params(axis="x", nbins=5)
            axes.set_xlabel(f"{item.coordinate} [{unit}]")
            axes.set_ylabel(f"residual [{units.effort}]")
        pictures.append(drawn.picture)
    return tuple(pictures)


def _all(traces: Sequence[Trace], values: Callable[[Trace], Floats]) -> Floats:
    """Return a signal of all traces."""
    return np.concatenate([values(one) for one in traces])
