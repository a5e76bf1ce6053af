"""One axis of a parameter file: its groups, its friction and effects, and the truth of its simulated stage."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from sgms_observer.settings.axis import AxisSettings, EffectSettings, Settings
from sgms_observer.settings.check import checked_group
from sgms_observer.settings.consistency import axis_consistency, friction_consistency, is_file
from sgms_observer.settings.declaration import declared_sections, declared_settings
from sgms_observer.settings.effects import Catalogue, checked_effects
from sgms_observer.settings.faults import Faults
from sgms_observer.settings.friction import FrictionSettings
from sgms_observer.settings.stage import StageSettings
from sgms_observer.settings.units import JOINT_TYPES, PRISMATIC, Units

_APART_IN_AXIS = ("effects", "stage", "friction")
_APART_IN_STAGE = ("friction", "effects")


def checked_axis(
    name: str, tree: Any, period: float, folder: Path, catalogue: Catalogue | None, faults: Faults
) -> AxisSettings:
    """Return one axis.

    Args:
        name: its name.
        tree: its settings as read.
        period: nominal sample period [s].
        folder: relative file names start here.
        catalogue: known effects; None when they are not known.
        faults: receives the sentences.
    """
    elsewhere = elsewhere_in(name)
    kind = tree.get("joint_type") if isinstance(tree, Mapping) else None
    kind = kind if kind in JOINT_TYPES else PRISMATIC
    axis = checked_group(
        name, AxisSettings(name=name), tree, faults, apart=_APART_IN_AXIS, elsewhere=elsewhere, joint_type=kind
    )
    if not isinstance(tree, Mapping):
        tree = {}
    friction = _friction(f"{name}.friction", axis.friction, tree.get("friction"), elsewhere, faults, kind)
    stage_tree = tree.get("stage")
    stage: StageSettings = checked_group(
        f"{name}.stage", axis.stage, stage_tree, faults, apart=_APART_IN_STAGE, elsewhere=elsewhere, joint_type=kind
    )
    reference = (
        replace(stage.reference, file=resolved(stage.reference.file, folder))
        if stage.reference.file
        else stage.reference
    )
    stage_friction: FrictionSettings | None = None
    stage_effects: tuple[EffectSettings, ...] | None = None
    if isinstance(stage_tree, Mapping):
        if stage_tree.get("friction") not in (None, {}):
            stage_friction = _friction(
                f"{name}.stage.friction", friction, stage_tree["friction"], elsewhere, faults, kind, f"{name}.friction"
            )
        if stage_tree.get("effects") is not None:
            stage_effects = checked_effects(f"{name}.stage.effects", stage_tree["effects"], catalogue, faults, kind)
    axis = replace(
        axis,
        friction=friction,
        stage=replace(stage, reference=reference),
        stage_friction=stage_friction,
        stage_effects=stage_effects,
        effects=checked_effects(f"{name}.effects", tree.get("effects"), catalogue, faults, kind),
    )
    axis_consistency(axis, period, faults)
    return axis


def _friction(
    path: str,
    defaults: FrictionSettings,
    tree: Any,
    elsewhere: Mapping[str, str],
    faults: Faults,
    joint_type: str,
    parent: str = "",
) -> FrictionSettings:
    """Return one friction model on top of its parent's; damping that the file leaves out is zero."""
    friction = checked_group(path, defaults, tree, faults, elsewhere=elsewhere, joint_type=joint_type)
    given = tuple(key for key in tree if isinstance(key, str)) if isinstance(tree, Mapping) else ()
    n_z = len(friction.element_stiffness)
    if "element_damping" not in given and len(friction.element_damping) != n_z:
        friction = replace(friction, element_damping=(0.0,) * n_z)
    friction_consistency(path, friction, given, faults, Units(joint_type), parent)
    return friction


@lru_cache(maxsize=8)
def _places() -> dict[str, str]:
    """Return where in an axis each setting stands; names that stand in several places are left out."""
    found: dict[str, str] = {}
    twice: set[str] = set()

    def walk(kind: type, prefix: str) -> None:
        for key in declared_settings(kind):
            if key in found:
                twice.add(key)
            found[key] = f"{prefix}.{key}"
        for key, (nested, _) in declared_sections(kind).items():
            found.setdefault(key, f"{prefix}.{key}")
            walk(nested, f"{prefix}.{key}")

    walk(AxisSettings, "")
    return {key: place for key, place in found.items() if key not in twice}


def elsewhere_in(axis: str) -> dict[str, str]:
    """Return the full name of every setting, by its short name, for guesses at what a misplaced one means."""
    shared = {key: key for key in (*declared_settings(Settings), "axes")}
    return {**{key: f"{axis}{place}" for key, place in _places().items()}, **shared}


def resolved(name: str, folder: Path) -> str:
    """Return a file name that works from the current folder, for one that starts at the parameter file's folder.

    Args:
        name: as it stands in the file.
        folder: the parameter file's.
    """
    if not name or Path(name).is_absolute() or folder == Path("."):
        return name
    beside = str(folder / name)
    return beside if is_file(beside) else name
