"""``x.effects``: names of the catalogue and the values of their parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from sgms_observer.effects.effect import Effect, EffectList, EffectParameter, EffectSettings, flat_values
from sgms_observer.settings.check import Faults, alternatives, checked_value, closest, shown
from sgms_observer.settings.declaration import DOUBLE, DOUBLES, STRINGS, Declared
from sgms_observer.settings.units import PRISMATIC, Units

#: The catalogue as the settings see it: effect by its name.
Catalogue = Mapping[str, Effect]
#: Returns the catalogue extended by the effects in the user's files.
CatalogueSource = Callable[[Sequence[str]], Catalogue]

#: The only entry of ``names`` for no effect: ROS passes on no empty lists.
NO_EFFECT = "none"

NAMES = Declared("names", STRINGS, (), "effects of the catalogue that act on this axis")


def _declared_parameter(parameter: EffectParameter, joint_type: str = PRISMATIC) -> Declared:
    """Return an effect's parameter as a setting; unit and some defaults follow the axis's type of joint."""
    is_own = joint_type == PRISMATIC and parameter.prismatic_default is not None
    return Declared(
        parameter.name,
        DOUBLE,
        parameter.prismatic_default if is_own else parameter.default,
        parameter.description,
        Units(joint_type).of(parameter.unit),
        minimum=parameter.minimum,
        maximum=parameter.maximum,
    )


def _declared_list(item: EffectList, joint_type: str = PRISMATIC) -> Declared:
    """Return an effect's list as a setting; its unit follows the axis's type of joint."""
    unit = Units(joint_type).of(item.unit)
    if item.choices:
        return Declared(item.name, STRINGS, item.default, item.description, unit, choices=item.choices)
    return Declared(
        item.name, DOUBLES, item.default, item.description, unit, minimum=item.minimum, maximum=item.maximum
    )


def declared_values(entry: Effect, joint_type: str = PRISMATIC) -> dict[str, Declared]:
    """Return every parameter of an effect as a setting, by its name.

    Args:
        entry: the effect.
        joint_type: of the axis; the units follow.
    """
    return {
        **{parameter.name: _declared_parameter(parameter, joint_type) for parameter in entry.parameters},
        **{item.name: _declared_list(item, joint_type) for item in entry.lists},
    }


def checked_effects(
    path: str, tree: Any, catalogue: Catalogue | None, faults: Faults, joint_type: str = PRISMATIC
) -> tuple[EffectSettings, ...]:
    """Return the effects of one axis with all their values, in the catalogue's order of parameters.

    Args:
        path: full name of the group, ``x.effects``.
        tree: ``{names: [...], cogging: {...}}`` as read.
        catalogue: known effects; None when they are unknown, so that names are not checked.
        faults: receives the sentences.
        joint_type: of the axis, for the units in the sentences.
    """
    if tree is None or catalogue is None:
        return ()
    if not isinstance(tree, Mapping):
        faults.add(path, f"{path} = {shown(tree)} must be a group of settings; write names: [...] below it, indented")
        return ()
    names = checked_value(f"{path}.names", NAMES, tree.get("names"), faults) or ()
    names = () if names == (NO_EFFECT,) else names
    found = []
    for index, name in enumerate(names):
        if name not in catalogue:
            _unknown_effect(f"{path}.names", name, catalogue, faults)
        elif name in names[:index]:
            faults.add(
                f"{path}.names",
                f"{path}.names = {shown(list(names))} must name each effect once; remove the second {name}",
            )
        else:
            found.append(_checked_effect(f"{path}.{name}", name, tree.get(name), catalogue[name], joint_type, faults))
    for key in tree:
        if key == "names" or key in names:
            continue
        if isinstance(key, str) and key in catalogue:
            faults.add(
                f"{path}.{key}",
                f"{path}.{key} has values but {path}.names = {shown(list(names))} must name it for it to act; "
                f"add {key} to names or remove its values",
            )
        else:
            guess = closest(key, [*catalogue, "names"]) if isinstance(key, str) else None
            remedy = f"did you mean {guess}?" if guess else "remove it"
            faults.add(f"{path}.{key}", f"{path}.{key if isinstance(key, str) else shown(key)} is no effect; {remedy}")
    return tuple(found)


def _unknown_effect(path: str, name: str, catalogue: Catalogue, faults: Faults) -> None:
    """Note a name that the catalogue does not have."""
    guess = closest(name, catalogue)
    remedy = (
        f"did you mean {guess}?" if guess else f"choose from {alternatives(catalogue)}" if catalogue else "remove it"
    )
    faults.add(path, f"{path} = {shown(name)} must be an effect of the catalogue; {remedy}")


def _checked_effect(path: str, name: str, tree: Any, entry: Effect, joint_type: str, faults: Faults) -> EffectSettings:
    """Return one effect with the given values over the catalogue's defaults."""
    declared = declared_values(entry, joint_type)
    values: dict[str, Any] = {}
    if tree is not None and not isinstance(tree, Mapping):
        faults.add(path, f"{path} = {shown(tree)} must be a group of parameters; write them below it, indented")
        tree = None
    for key, raw in (tree or {}).items():
        if isinstance(key, str) and key in declared and declared[key].is_list and not isinstance(raw, (list, tuple)):
            example = (declared[key].choices or ("0.0, 1.0",))[0]
            faults.add(f"{path}.{key}", f"{path}.{key} = {shown(raw)} must be a list; write it like [{example}]")
        elif isinstance(key, str) and key in declared:
            value = checked_value(f"{path}.{key}", declared[key], raw, faults)
            if value is not None:
                values[key] = value
        else:
            guess = closest(key, declared) if isinstance(key, str) else None
            remedy = f"did you mean {guess}?" if guess else f"it has {', '.join(declared) or 'none'}"
            faults.add(
                f"{path}.{key}",
                f"{path}.{key if isinstance(key, str) else shown(key)} is no parameter of {name}; {remedy}",
            )
    lists = {item.name: values.get(item.name, item.default) for item in entry.lists}
    if entry.list_faults is not None and not any(faults.has(f"{path}.{key}") for key in lists):
        for sentence in entry.list_faults(lists, path):
            faults.add(path, sentence)
    defaults = {key: item.default for key, item in declared.items()}
    return EffectSettings(name, flat_values(entry, {**defaults, **values}))
