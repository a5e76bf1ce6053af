"""Writes settings to a parameter file, completely or not at all, in a form that every parser reads alike."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

from sgms_observer.effects.effect import named_values
from sgms_observer.settings.axis import AxisSettings, EffectSettings, FrictionSettings, Settings
from sgms_observer.settings.check import Faults, checked_value
from sgms_observer.settings.declaration import DOUBLE, DOUBLES, STRINGS, Declared, declared_sections, declared_settings
from sgms_observer.settings.effects import NAMES, NO_EFFECT, Catalogue, CatalogueSource
from sgms_observer.settings.load import AXES, ROS_SWITCHES, installed_catalogue
from sgms_observer.settings.parameter_file import expanded, our_sections, sections
from sgms_observer.settings.yaml_text import keyed_lines, text_of
from sgms_observer.whole_file import write_text

#: Types of a parameter of an effect: a number, a list of numbers, or a list of words.
_EFFECT_NUMBER = Declared("value", DOUBLE, 0.0, "a parameter of an effect")
_EFFECT_NUMBERS = Declared("value", DOUBLES, (), "a list of an effect")
_EFFECT_WORDS = Declared("value", STRINGS, (), "a list of words of an effect")

Comments = Mapping[str, str]

#: Result of ``_at`` for a missing key.
_MISSING = object()


def normal_parameters(tree: Mapping[Any, Any], file_name: Callable[[str], str] = str) -> dict[Any, Any]:
    """Return a tree of parameters with every known value written as its declared type.

    Numbers meant as doubles become doubles, single values of lists become lists, and texts are plain texts again.
    Unknown settings and invalid values are not changed; the check reports them.

    Args:
        tree: the parameters of a node, ``{"axes": [...], "x": {...}}``.
        file_name: rewrites each file name in it, for a tree that moves to another folder.
    """
    settings = {**declared_settings(Settings), **ROS_SWITCHES, "axes": AXES}
    result: dict[Any, Any] = {}
    axes = checked_value("axes", AXES, tree.get("axes", ["x"]), Faults()) or ()
    for key, value in tree.items():
        if isinstance(key, str) and key in settings:
            result[key] = _normal_value(settings[key], value)
        elif isinstance(key, str) and key in axes:
            result[key] = _normal_axis(value, file_name)
        else:
            result[key] = value
    if isinstance(result.get("effect_files"), list):
        result["effect_files"] = [file_name(name) for name in result["effect_files"]]
    return result


def _normal_value(declared: Declared, raw: Any) -> Any:
    """Return one value as its declared type, or as it is."""
    if raw is None:
        return [] if declared.is_list else "" if declared.default == "" else raw
    loose = Declared(declared.name, declared.kind, declared.default, declared.description)  # types only, no bounds
    value = checked_value(declared.name, loose, raw, Faults())
    if value is None:
        return raw
    if isinstance(value, tuple):
        return [str(entry) if isinstance(entry, str) else entry for entry in value]
    return str(value) if isinstance(value, str) else value


def _normal_group(kind: type, tree: Any, rewriters: Mapping[str, Callable[[Any], Any]] | None = None) -> Any:
    """Return a group of settings in normal form; ``rewriters`` rewrites the keys that no dataclass field declares."""
    if not isinstance(tree, Mapping):
        return {} if tree is None else tree
    settings, groups = declared_settings(kind), declared_sections(kind)
    result = {}
    for key, value in tree.items():
        if isinstance(key, str) and rewriters and key in rewriters:
            result[key] = rewriters[key](value)
        elif isinstance(key, str) and key in settings:
            result[key] = _normal_value(settings[key], value)
        elif isinstance(key, str) and key in groups:
            result[key] = _normal_group(groups[key][0], value)
        else:
            result[key] = value
    return result


def _normal_axis(tree: Any, file_name: Callable[[str], str]) -> Any:
    """Return one axis in normal form."""

    def normal_stage(stage: Any) -> Any:
        rewriters = {"friction": lambda value: _normal_group(FrictionSettings, value), "effects": _normal_stage_effects}
        result = _normal_group(declared_sections(AxisSettings)["stage"][0], stage, rewriters)
        reference = result.get("reference") if isinstance(result, Mapping) else None
        if isinstance(reference, dict) and isinstance(reference.get("file"), str) and reference["file"]:
            reference["file"] = file_name(reference["file"])
        return result

    return _normal_group(AxisSettings, tree, {"effects": _normal_effects, "stage": normal_stage})


def _normal_effect_value(raw: Any) -> Any:
    """Return a parameter of an effect in normal form: a number, a list of numbers or a list of words."""
    if not isinstance(raw, (list, tuple)):
        return _normal_value(_EFFECT_NUMBER, raw)
    is_numbers = checked_value(_EFFECT_NUMBERS.name, _EFFECT_NUMBERS, raw, Faults()) is not None
    return _normal_value(_EFFECT_NUMBERS if is_numbers else _EFFECT_WORDS, raw)


def _normal_effects(tree: Any) -> Any:
    """Return the effects of an axis in normal form."""
    if not isinstance(tree, Mapping):
        return {} if tree is None else tree
    result: dict[Any, Any] = {}
    for key, value in tree.items():
        if key == "names":
            result[key] = _normal_value(NAMES, value)
        elif isinstance(value, Mapping):
            result[key] = {name: _normal_effect_value(raw) for name, raw in value.items()}
        else:
            result[key] = {} if value is None else value
    return result


def _normal_stage_effects(tree: Any) -> Any:
    """Return the true effects; no effect is the word ``none``, because ROS passes on no empty list."""
    result = _normal_effects(tree)
    if tree is not None and isinstance(result, dict) and not result.get("names"):
        result["names"] = [NO_EFFECT]
    return result


def given_parameters(tree: Mapping[Any, Any]) -> dict[str, Any]:
    """Return the parameters of a tree that a node declares, by their full names and with their declared types.

    Args:
        tree: checked parameters of a node. Nulls, empty lists and empty groups mean what leaving them out means.
    """
    known = {*declared_settings(Settings), *ROS_SWITCHES, "axes"}
    normal = normal_parameters(tree)
    axes = normal.get("axes", AXES.default)
    return _by_full_name({key: value for key, value in normal.items() if key in known or key in axes}, "")


def _by_full_name(tree: Mapping[Any, Any], prefix: str) -> dict[str, Any]:
    """Return the values of a tree without its groups."""
    found: dict[str, Any] = {}
    for key, value in tree.items():
        if isinstance(value, Mapping):
            found |= _by_full_name(value, f"{prefix}{key}.")
        elif value is not None and value != []:
            found[f"{prefix}{key}"] = value
    return found


def updated_tree(tree: Mapping[Any, Any], axis: str, changes: Mapping[str, Any]) -> dict[Any, Any]:
    """Return a copy of a tree with changed settings of one axis.

    Args:
        tree: a document with its sections (``Settings.source``), or the parameters alone.
        axis: name of the axis; empty for what the axes share.
        changes: ``friction.static_force`` to its new value; None removes the setting or group.

    Returns:
        The tree; each change is in the section that had the setting, a new one next to the axis's other settings.
    """
    document = dict(tree) if any(sections(tree)) else dict(expanded(tree))
    places = [place for _, place, _ in our_sections(document)] or [()]
    for place in filter(None, places):
        _put(document, place, dict(expanded(_at(document, place) or {})))
    for dotted, value in changes.items():
        keys = (*([axis] if axis else []), *dotted.split("."))
        holding = [place for place in places if _at(document, (*place, *keys)) is not _MISSING]
        in_same_group = [place for place in places if _at(document, (*place, keys[0])) is not _MISSING]
        chosen = holding if value is None else holding[-1:] or [(in_same_group or places)[-1]]
        for place in chosen:
            _put(document, (*place, *keys), value)
    return document


def _at(tree: Any, keys: Sequence[str]) -> Any:
    """Return the value at these keys, or ``_MISSING``."""
    for key in keys:
        if not isinstance(tree, Mapping) or key not in tree:
            return _MISSING
        tree = tree[key]
    return tree


def _put(tree: dict[Any, Any], keys: Sequence[str], value: Any) -> None:
    """Set the value at these keys in ``tree``, with a copy of every group on the path; None removes it."""
    for key in keys[:-1]:
        below = tree.get(key)
        tree[key] = dict(below) if isinstance(below, Mapping) else {}
        tree = tree[key]
    if value is None:
        tree.pop(keys[-1], None)
    else:
        tree[keys[-1]] = _plain(value)


def _plain(value: Any) -> Any:
    """Return a value with Python's own numbers and lists in place of numpy's."""
    if isinstance(value, Mapping):
        return {key: _plain(entry) for key, entry in value.items()}
    if hasattr(value, "tolist"):
        return value.tolist()
    return [_plain(entry) for entry in value] if isinstance(value, (list, tuple)) else value


def tree_of(settings: Settings, catalogue: CatalogueSource = installed_catalogue) -> dict[str, Any]:
    """Return the document of settings with every value written out.

    Args:
        settings: checked settings.
        catalogue: gives the names of the effects' parameters.
    """
    known = catalogue(settings.effect_files) if any(a.effects or a.stage_effects for a in settings.axes) else {}
    tree: dict[str, Any] = {"axes": [axis.name for axis in settings.axes], **_group_tree(settings)}
    for axis in settings.axes:
        axis_tree = _group_tree(axis)
        axis_tree["effects"] = _effects_tree(axis.effects, known)
        if axis.stage_friction is not None:
            axis_tree["stage"]["friction"] = _group_tree(axis.stage_friction)
        if axis.stage_effects is not None:
            axis_tree["stage"]["effects"] = (
                _effects_tree(axis.stage_effects, known) if axis.stage_effects else {"names": [NO_EFFECT]}
            )
        tree[axis.name] = axis_tree
    return {"/**": {"ros__parameters": tree}}


def _kept_stage_friction(settings: Settings, axis: str, changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return every friction value of the stage, if the file lists some of them.

    A value that the file leaves out is that of the observer's friction. Where the observer's friction changes, the
    simulated truth is written in full, so that it does not change.
    """
    friction = next((one.stage_friction for one in settings.axes if one.name == axis), None)
    if friction is None or not any(key.startswith("friction.") for key in changes):
        return {}
    return {f"stage.friction.{key}": value for key, value in _group_tree(friction).items()}


def _group_tree(group: Any) -> dict[str, Any]:
    """Return a group of settings as nested mappings."""
    kind = type(group)
    tree: dict[str, Any] = {}
    for entry in fields(group):
        value = getattr(group, entry.name)
        if entry.name in declared_settings(kind):
            tree[entry.name] = list(value) if isinstance(value, tuple) else value
        elif entry.name in declared_sections(kind) and is_dataclass(value):
            tree[entry.name] = _group_tree(value)
    return tree


def _effects_tree(effects: Sequence[EffectSettings], known: Catalogue) -> dict[str, Any]:
    """Return effects in the form of the YAML."""
    tree: dict[str, Any] = {"names": [effect.name for effect in effects]}
    for effect in effects:
        named = named_values(known[effect.name], effect.values) or {}
        tree[effect.name] = {
            key: list(value) if isinstance(value, tuple) else value for key, value in named.items() if value != ()
        }
    return tree


def yaml_of(
    tree: Mapping[Any, Any], comments: Comments | None = None, *, read_from: Path | None = None, to: Path | None = None
) -> str:
    """Return a tree as the text of a parameter file.

    Args:
        tree: a document with its sections, or the parameters alone.
        comments: parameter's full name to a remark after it; the empty name for lines at the head of the file.
        read_from: folder that relative file names in the tree start at.
        to: folder that they will start at.
    """

    def moved(name: str) -> str:
        if read_from is None or to is None or Path(name).is_absolute() or not (read_from / name).exists():
            return name
        return os.path.relpath(read_from / name, to)

    document = dict(tree) if any(sections(tree)) else {"/**": {"ros__parameters": dict(tree)}}
    for _, place, parameters in our_sections(document):
        if isinstance(parameters, Mapping):
            normal = normal_parameters(expanded(parameters), moved)
            _put(document, place[:-1], {**_at(document, place[:-1]), place[-1]: normal})
    return _commented(text_of(document), comments or {})


def _commented(text: str, comments: Comments) -> str:
    """Return YAML text with remarks, each at the first place of its parameter."""
    left = dict(comments)
    lines = [f"# {line}".rstrip() for line in left.pop("", "").splitlines()]
    for line, name, indent in keyed_lines(text):
        remark = " ".join(left.pop(name.partition("ros__parameters.")[2] or name, "").split())
        if remark and line.endswith(":"):
            lines.append(f"{indent}# {remark}")
        elif remark:
            line = f"{line}  # {remark}"
        lines.append(line)
    return "\n".join(lines) + "\n"


def write_settings(
    settings: Settings, path: str | Path, changes: Mapping[str, Mapping[str, Any]], comments: Comments | None = None
) -> None:
    """Write settings as they were read, with changes.

    Args:
        settings: settings with their ``source``.
        path: the file.
        changes: axis (or the empty name for what axes share) to ``{"friction.static_force": 4.2}``.
        comments: as for ``yaml_of``.

    Raises:
        RecordingError: the file cannot be written.
    """
    write_text(settings_text(settings, path, changes, comments), path)


def settings_text(
    settings: Settings, path: str | Path, changes: Mapping[str, Mapping[str, Any]], comments: Comments | None = None
) -> str:
    """Return the text that ``write_settings`` writes.

    Args:
        settings: settings with their ``source``.
        path: the file; relative file names in it are rewritten for its folder.
        changes: as for ``write_settings``.
        comments: as for ``yaml_of``.
    """
    tree: dict[Any, Any] = settings.source or tree_of(settings)
    for axis, axis_changes in changes.items():
        tree = updated_tree(tree, axis, {**_kept_stage_friction(settings, axis, axis_changes), **axis_changes})
    return yaml_of(tree, comments, read_from=Path(settings.folder).resolve(), to=Path(path).resolve().parent)
