"""What ``~/save_parameters`` writes: the parameter file with what was learnt. No ROS in here."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

from sgms_observer.nodes.engine import Engine
from sgms_observer.observer.learnt import learnt_changes, learnt_remarks
from sgms_observer.settings.axis import Settings
from sgms_observer.settings.parameter_file import overlaid, parameter_tree
from sgms_observer.settings.write import write_settings


def save_learnt(settings: Settings, given: Settings | None, engine: Engine, name: str) -> str:
    """Write the file, and return the sentence about it.

    Args:
        settings: of the node.
        given: what the node was started with, those of other nodes included.
        engine: of the node.
        name: of the node.

    Raises:
        SgmsError: the file cannot be written.
    """
    changes, comments = {}, {}
    for number, estimates in engine.latest.items():
        axis = settings.axes[number]
        values = dict(zip(axis.estimator.parameters, estimates.parameters[-1].tolist(), strict=True))
        if values:
            changes[axis.name] = learnt_changes(axis, values, engine.observers[number].effects.added_mass)
            for parameter, remark in learnt_remarks(axis, changes[axis.name], name).items():
                comments[f"{axis.name}.{parameter}"] = remark
    now = datetime.now(UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
    samples = max((statistics.total for statistics in engine.statistics), default=0)
    comments[""] = f"Written by {name} on {now} after {samples} samples."
    path = Path(settings.save_file).expanduser().resolve()
    write_settings(_with_stage(settings, given), path, changes, comments)
    what = (
        ", ".join(f"{axis}: {' '.join(names)}" for axis, names in changes.items())
        or "nothing learnt, settings as they are"
    )
    return f"wrote {path} ({what})"


def _with_stage(settings: Settings, given: Settings | None) -> Settings:
    """Return the settings with what the parameter file says of the stage, which the observer does not declare."""
    if given is None:
        return settings
    tree = parameter_tree(given.source, "the parameters")
    stages = {
        axis.name: {"stage": tree[axis.name]["stage"]} for axis in settings.axes if "stage" in tree.get(axis.name, {})
    }
    own = parameter_tree(settings.source, "the parameters")
    return replace(settings, source={"/**": {"ros__parameters": overlaid(own, stages)}})
