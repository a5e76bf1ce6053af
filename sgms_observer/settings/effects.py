"""``x.effects``: names of the catalogue and the values of their parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

from sgms_observer.settings.axis import EffectSettings
from sgms_observer.settings.check import checked_value
from sgms_observer.settings.declaration import DOUBLE, STRINGS, Declared
from sgms_observer.settings.faults import Faults, alternatives, closest, shown
from sgms_observer.settings.units import PRISMATIC, Units


class EffectParameter(Protocol):
    """What the settings need to know of one parameter of an effect."""

    @property
    def name(self) -> str: ...
    @property
    def unit(self) -> str: ...
    @property
    def default(self) -> float: ...
    @property
    def minimum(self) -> float: ...
    @property
    def maximum(self) -> float: ...
    @property
    def description(self) -> str: ...


#: The catalogue as the settings see it: effect name to its parameters, in order.
Catalogue = Mapping[str, Sequence[EffectParameter]]
#: Gives the catalogue extended by the effects in the user's own files.
CatalogueSource = Callable[[Sequence[str]], Catalogue]

#: Stands alone in ``names`` for none at all, where an empty list is not possible: ROS hands on no empty lists.
NO_EFFECT = "none"

NAMES = Declared("names", STRINGS, (), "effects of the catalogue that act on this axis")


def declared_parameter(parameter: EffectParameter, joint_type: str = PRISMATIC) -> Declared:
    """Return an effect's parameter as a setting.

    Args:
        parameter: entry of the catalogue.
        joint_type: of the axis that the effect acts on; the unit follows it.
    """
    return Declared(
        parameter.name,
        DOUBLE,
        parameter.default,
        parameter.description,
        Units(joint_type).of(parameter.unit),
        minimum=parameter.minimum,
        maximum=parameter.maximum,
    )


def checked_effects(
    path: str, tree: Any, catalogue: Catalogue | None, faults: Faults, joint_type: str = PRISMATIC
) -> tuple[EffectSettings, ...]:
    """Return the effects of one axis with all their values, in the catalogue's order of parameters.

    Args:
        path: full name of the group, ``x.effects``.
        tree: ``{names: [...], cogging: {...}}`` as read.
        catalogue: known effects; None when they are not known, so that nothing can be said.
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
            parameters = {p.name: declared_parameter(p, joint_type) for p in catalogue[name]}
            found.append(_checked_effect(f"{path}.{name}", name, tree.get(name), parameters, faults))
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


def _checked_effect(
    path: str, name: str, tree: Any, declared: Mapping[str, Declared], faults: Faults
) -> EffectSettings:
    """Return one effect with the given values over the catalogue's defaults."""
    values = {key: float(entry.default) for key, entry in declared.items()}
    if tree is not None and not isinstance(tree, Mapping):
        faults.add(path, f"{path} = {shown(tree)} must be a group of parameters; write them below it, indented")
        tree = None
    for key, raw in (tree or {}).items():
        if isinstance(key, str) and key in declared:
            value = checked_value(f"{path}.{key}", declared[key], raw, faults)
            values[key] = values[key] if value is None else value
        else:
            guess = closest(key, declared) if isinstance(key, str) else None
            remedy = f"did you mean {guess}?" if guess else f"it has {', '.join(declared) or 'none'}"
            faults.add(
                f"{path}.{key}",
                f"{path}.{key if isinstance(key, str) else shown(key)} is no parameter of {name}; {remedy}",
            )
    return EffectSettings(name, tuple(values.values()))
