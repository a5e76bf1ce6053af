"""Checks single values and groups of settings; each fault is one sentence."""

from __future__ import annotations

import difflib
import math
import re
import reprlib
from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace
from typing import Any, TypeVar

from sgms_observer.settings.declaration import (
    BOOL,
    DOUBLE,
    DOUBLES,
    INTEGER,
    Declared,
    declared_sections,
    declared_settings,
)
from sgms_observer.settings.units import PRISMATIC

_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = _SHORT.maxlong = 60
_SHORT.maxlevel = 3

Group = TypeVar("Group")

_DIGITS = "[0-9]+(?:_[0-9]+)*"
_NUMBER = re.compile(rf"[-+]?({_DIGITS}\.?({_DIGITS})?|\.{_DIGITS})([eE][-+]?[0-9]+)?")
_TRUE = ("true", "yes", "on", "y")
_FALSE = ("false", "no", "off", "n")
_LARGEST_INTEGER = 2**63 - 1
_NOT_MEANT = object()


class Faults:
    """Sentences about faults in the order of the file, and the faulty parameters."""

    def __init__(self) -> None:
        self.sentences: list[str] = []
        self._paths: set[str] = set()

    def add(self, path: str, sentence: str) -> None:
        """Note one fault.

        Args:
            path: the parameter's full name, ``x.friction.static_force``.
            sentence: parameter, value, rule, remedy.
        """
        self._paths.add(path)
        self.sentences.append(sentence)

    def has(self, *paths: str) -> bool:
        """Return whether any of these parameters has a fault already."""
        return not self._paths.isdisjoint(paths)


def shown(value: Any) -> str:
    """Return a value as YAML text, shortened if it is long."""
    if value is None:
        return "(nothing)"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return f"{value:.12g}"
    if isinstance(value, Mapping):
        return "(a group of settings)"
    if isinstance(value, (list, tuple)):
        inside = ", ".join("[...]" if isinstance(entry, (list, tuple)) else shown(entry) for entry in value[:6])
        return f"[{inside}{', ...' if len(value) > 6 else ''}]"
    try:
        return _SHORT.repr(value).replace("\n", " ")
    except ValueError:  # Python does not print integers of thousands of digits
        return "(a number of thousands of digits)"


def alternatives(words: Iterable[str]) -> str:
    """Return ``a, b or c``."""
    listed = list(words)
    return listed[0] if len(listed) == 1 else f"{', '.join(listed[:-1])} or {listed[-1]}"


def closest(word: str, words: Iterable[str]) -> str | None:
    """Return the most similar known word, or None."""
    known = {entry.lower(): entry for entry in words}
    found = difflib.get_close_matches(word[:80].lower(), known, n=1, cutoff=0.6)
    return known[found[0]] if found else None


def as_number(raw: Any) -> float | None:
    """Return a value as a finite number, or None.

    PyYAML reads ``1e-4`` as text, and rcl refuses an integer for a double; both count as numbers here.
    """
    if isinstance(raw, str) and _NUMBER.fullmatch(raw.strip()):
        raw = float(raw)
    if isinstance(raw, bool) or not isinstance(raw, (int, float)):
        return None
    try:
        number = float(raw)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


def _meant(kind: str, raw: Any) -> Any:
    """Return one entry (not a list) as its declared kind, or ``_NOT_MEANT``."""
    if kind in (DOUBLE, DOUBLES, INTEGER):
        number = as_number(raw)
        if number is None:
            return _NOT_MEANT
        if kind != INTEGER:
            return number
        if not number.is_integer() or abs(number) > _LARGEST_INTEGER:
            return _NOT_MEANT
        return raw if isinstance(raw, int) else int(number)
    if kind == BOOL:
        word = raw.strip().lower() if isinstance(raw, str) else raw
        if isinstance(word, bool):
            return word
        return True if word in _TRUE else False if word in _FALSE else _NOT_MEANT
    return raw if isinstance(raw, str) else _NOT_MEANT


def _expectation(declared: Declared) -> str:
    """Return the rule and remedy for a value of the wrong type."""
    unit = f" in {declared.unit}" if declared.unit != "-" else ""
    if declared.choices:
        return f"must be {alternatives(declared.choices)}; choose one"
    if declared.kind in (DOUBLE, DOUBLES):
        return f"must be a finite number{unit}; write it like {_example(declared)}"
    if declared.kind == INTEGER:
        return f"must be a whole number; write it like {declared.default}"
    return "must be true or false; write one of the two" if declared.kind == BOOL else "must be text; put it in quotes"


def _example(declared: Declared) -> str:
    """Return an example of a valid number, with its point."""
    default = declared.default if not declared.is_list else declared.default[0] if declared.default else 1.0
    return f"{default:.1f}" if float(default).is_integer() else shown(float(default))


def _range_rule(value: float, declared: Declared) -> str | None:
    """Return the rule that a number breaks and its remedy, or None."""
    if declared.is_nonzero and value == 0.0:
        return "must not be 0; write 1.0 for no scaling"
    if declared.above is not None and not value > declared.above:
        return f"must be > {shown(float(declared.above))}; raise it"
    if declared.minimum is not None and value < declared.minimum:
        return f"must be >= {shown(float(declared.minimum))}; raise it"
    if declared.maximum is not None and value > declared.maximum:
        return f"must be <= {shown(float(declared.maximum))}; lower it"
    return None


def _checked_entry(path: str, declared: Declared, raw: Any, where: str, faults: Faults) -> Any:
    """Return one entry as its declared type, or note the fault and return None; ``where`` numbers an entry."""
    value = _meant(declared.kind, raw)
    if value is _NOT_MEANT:
        faults.add(path, f"{path} = {shown(raw)}{where} {_expectation(declared)}")
        return None
    if isinstance(value, str):
        if any("\ud800" <= letter <= "\udfff" for letter in value):  # a name that is no text: ROS has none such
            faults.add(path, f"{path} = {shown(raw)}{where} must be text in UTF-8; rename the file or folder")
            return None
        if declared.choices and value not in declared.choices:
            guess = closest(value, declared.choices)
            remedy = f"did you mean {guess}?" if guess else "choose one"
            faults.add(path, f"{path} = {shown(raw)}{where} must be {alternatives(declared.choices)}; {remedy}")
            return None
        return value
    rule = None if isinstance(value, bool) else _range_rule(value, declared)
    if rule:
        unit = f" {declared.unit}" if declared.unit != "-" else ""
        faults.add(path, f"{path} = {shown(value)}{unit}{where} {rule}")
        return None
    return value


def checked_value(path: str, declared: Declared, raw: Any, faults: Faults) -> Any:
    """Return a setting as its declared type, or note every fault of it and return None.

    Args:
        path: full name of the parameter.
        declared: its declaration.
        raw: as read; a single value stands for a list of one, nothing for an empty list.
        faults: receives the sentences.
    """
    if not declared.is_list:
        if raw is None and declared.default == "":
            return ""
        if raw is None:
            faults.add(path, f"{path} has no value; give one or remove the line")
            return None
        return _checked_entry(path, declared, raw, "", faults)
    if isinstance(raw, Mapping):
        example = "[1.0]" if declared.kind == DOUBLES else "[a]"
        faults.add(path, f"{path} = {shown(raw)} must be a list; write it like {example}")
        return None
    entries = [] if raw is None else list(raw) if isinstance(raw, (list, tuple)) else [raw]
    found = []
    for index, entry in enumerate(entries):
        where = f" in entry {index + 1}" if len(entries) > 1 else ""
        found.append(_checked_entry(path, declared, entry, where, faults))
    return None if any(entry is None for entry in found) else tuple(found)


def unknown_key(path: str, key: Any, known: Collection[str], elsewhere: Mapping[str, str], faults: Faults) -> None:
    """Note a key that is no setting, with the most similar setting.

    Args:
        path: full name of the group it stands in; empty at the top.
        key: the key as read.
        known: the keys of that group.
        elsewhere: settings of other groups, name to full name.
        faults: receives the sentence.
    """
    prefix = f"{path}." if path else ""
    full = f"{prefix}{key if isinstance(key, str) else shown(key)}"
    if not isinstance(key, str):
        faults.add(full, f"{full} is not the name of a setting; put quotes around it if it is a name, or remove it")
        return
    guess = closest(key, known)
    if key in elsewhere:
        remedy = f"did you mean {elsewhere[key]}?"
    elif guess:
        remedy = f"did you mean {prefix}{guess}?"
    else:
        remedy = "remove it, or look its name up in docs/parameters.md"
    faults.add(full, f"{full} is not a setting; {remedy}")


def checked_group(
    path: str,
    defaults: Group,
    tree: Any,
    faults: Faults,
    *,
    separate: Collection[str] = (),
    elsewhere: Mapping[str, str] | None = None,
    joint_type: str = PRISMATIC,
) -> Group:
    """Return a group of settings read from a mapping, on top of its defaults.

    Args:
        path: full name of the group; empty at the top.
        defaults: the default values of the group.
        tree: the mapping as read; nothing stands for an empty one.
        faults: receives every sentence; a faulty setting keeps its default.
        separate: keys that the caller reads itself.
        elsewhere: settings of other groups for suggestions, name to full name.
        joint_type: of the axis that the group belongs to; the sentences have its units.
    """
    if tree is None:
        return defaults
    if not isinstance(tree, Mapping):
        faults.add(path, f"{path} = {shown(tree)} must be a group of settings; write them below it, indented")
        return defaults
    settings, sections = declared_settings(type(defaults)), declared_sections(type(defaults))
    prefix = f"{path}." if path else ""
    given: dict[str, Any] = {}
    for key, raw in tree.items():
        if isinstance(key, str) and key in separate:
            continue
        if isinstance(key, str) and key in sections:
            nested = getattr(defaults, key)
            given[key] = checked_group(
                f"{prefix}{key}", nested, raw, faults, elsewhere=elsewhere, joint_type=joint_type
            )
        elif isinstance(key, str) and key in settings:
            value = checked_value(f"{prefix}{key}", settings[key].of_joint_type(joint_type), raw, faults)
            if value is not None:
                given[key] = value
        else:
            unknown_key(path, key, [*settings, *sections, *separate], elsewhere or {}, faults)
    return replace(defaults, **given) if given else defaults  # type: ignore[type-var]
