"""A parameter tree in the one form that every parser reads alike: what is meant, written as its declared type."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from sgms_observer.settings.axis import AxisSettings, FrictionSettings, Settings
from sgms_observer.settings.check import Faults, checked_value
from sgms_observer.settings.declaration import DOUBLE, DOUBLES, STRINGS, Declared, declared_sections, declared_settings
from sgms_observer.settings.effects import NAMES, NO_EFFECT
from sgms_observer.settings.load import AXES, ROS_SWITCHES

#: What a parameter of an effect may be: a number, a list of numbers, or a list of words.
_EFFECT_NUMBER = Declared("value", DOUBLE, 0.0, "a parameter of an effect")
_EFFECT_NUMBERS = Declared("value", DOUBLES, (), "a list of an effect")
_EFFECT_WORDS = Declared("value", STRINGS, (), "a list of words of an effect")


def normal_parameters(tree: Mapping[Any, Any], file_name: Callable[[str], str] = str) -> dict[Any, Any]:
    """Return a tree of parameters with every known value written as its declared type.

    Numbers meant as doubles become doubles, single values of lists become lists, and texts are plain texts again.
    What is no setting, or cannot be meant, stays as it is for the check to speak about.

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


def _normal_group(kind: type, tree: Any, apart: Mapping[str, Callable[[Any], Any]] | None = None) -> Any:
    """Return a group of settings in normal form; ``apart`` rewrites the keys that no dataclass field declares."""
    if not isinstance(tree, Mapping):
        return {} if tree is None else tree
    settings, groups = declared_settings(kind), declared_sections(kind)
    result = {}
    for key, value in tree.items():
        if isinstance(key, str) and apart and key in apart:
            result[key] = apart[key](value)
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
        own = {"friction": lambda value: _normal_group(FrictionSettings, value), "effects": _normal_stage_effects}
        result = _normal_group(declared_sections(AxisSettings)["stage"][0], stage, own)
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
    """Return the true effects; none at all is a word, because an empty list does not reach a node."""
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
    """Return what a tree holds, without its groups."""
    found: dict[str, Any] = {}
    for key, value in tree.items():
        if isinstance(value, Mapping):
            found |= _by_full_name(value, f"{prefix}{key}.")
        elif value is not None and value != []:
            found[f"{prefix}{key}"] = value
    return found
