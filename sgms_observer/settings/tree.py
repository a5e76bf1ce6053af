"""Trees of parameters: one setting changed, or checked settings written out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

from sgms_observer.effects.effect import named_values
from sgms_observer.settings.axis import EffectSettings, Settings
from sgms_observer.settings.declaration import declared_sections, declared_settings
from sgms_observer.settings.effects import NO_EFFECT, Catalogue, CatalogueSource
from sgms_observer.settings.load import installed_catalogue
from sgms_observer.settings.parameter_file import expanded, our_sections, sections

#: What ``at`` returns where there is nothing, not even null.
MISSING = object()


def updated_tree(tree: Mapping[Any, Any], axis: str, changes: Mapping[str, Any]) -> dict[Any, Any]:
    """Return a copy of a tree with settings of one axis changed; the given tree stays as it is.

    Args:
        tree: a document with its sections (``Settings.source``), or the parameters alone.
        axis: name of the axis; empty for what the axes share.
        changes: ``friction.static_force`` to its new value; None removes the setting or group.

    Returns:
        The tree; each change stands in the section that had the setting, a new one beside the axis's other settings.
    """
    document = dict(tree) if any(sections(tree)) else dict(expanded(tree))
    places = [place for _, place, _ in our_sections(document)] or [()]
    for place in filter(None, places):
        put(document, place, dict(expanded(at(document, place) or {})))
    for dotted, value in changes.items():
        keys = (*([axis] if axis else []), *dotted.split("."))
        holding = [place for place in places if at(document, (*place, *keys)) is not MISSING]
        beside = [place for place in places if at(document, (*place, keys[0])) is not MISSING]
        chosen = holding if value is None else holding[-1:] or [(beside or places)[-1]]
        for place in chosen:
            put(document, (*place, *keys), value)
    return document


def at(tree: Any, keys: Sequence[str]) -> Any:
    """Return what stands at these keys, or ``MISSING``."""
    for key in keys:
        if not isinstance(tree, Mapping) or key not in tree:
            return MISSING
        tree = tree[key]
    return tree


def put(tree: dict[Any, Any], keys: Sequence[str], value: Any) -> None:
    """Set what stands at these keys in ``tree``, copying every group on the way; None removes it."""
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
        own = _group_tree(axis)
        own["effects"] = _effects_tree(axis.effects, known)
        if axis.stage_friction is not None:
            own["stage"]["friction"] = _group_tree(axis.stage_friction)
        if axis.stage_effects is not None:
            own["stage"]["effects"] = (
                _effects_tree(axis.stage_effects, known) if axis.stage_effects else {"names": [NO_EFFECT]}
            )
        tree[axis.name] = own
    return {"/**": {"ros__parameters": tree}}


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
    """Return effects as they stand in the YAML."""
    tree: dict[str, Any] = {"names": [effect.name for effect in effects]}
    for effect in effects:
        named = named_values(known[effect.name], effect.values) or {}
        tree[effect.name] = {
            key: list(value) if isinstance(value, tuple) else value for key, value in named.items() if value != ()
        }
    return tree
