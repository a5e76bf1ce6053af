"""The catalogue: every effect by its name, the package's and the user's own."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterable, Sequence
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any

from sgms_observer.effects.effect import Effect, Place
from sgms_observer.effects.force_entries import FORCE_EFFECTS
from sgms_observer.effects.level_entries import LEVEL_EFFECTS
from sgms_observer.effects.map_entries import MAP_EFFECTS
from sgms_observer.effects.path_entries import PATH_EFFECTS
from sgms_observer.errors import ConfigurationError

ENTRY_POINT_GROUP = "sgms_observer.effects"
USER_PLACES = (Place.ADDED_FORCE, Place.LEVEL_FACTOR)
BUILT_IN: tuple[Effect, ...] = FORCE_EFFECTS + LEVEL_EFFECTS + PATH_EFFECTS + MAP_EFFECTS

_effects: dict[str, Effect] = {entry.name: entry for entry in BUILT_IN}
_loaded: set[str] = set()


def names() -> tuple[str, ...]:
    """Return the name of every effect, the package's own first."""
    return tuple(_effects)


def effect(name: str) -> Effect:
    """Return one effect.

    Args:
        name: its name in the catalogue.

    Raises:
        ConfigurationError: when the catalogue has none of that name.
    """
    if name not in _effects:
        raise ConfigurationError([f"effect {name} is not in the catalogue; use one of {', '.join(names())}"])
    return _effects[name]


def is_contact_law(name: str) -> bool:
    """Return whether an effect only describes another contact law, or is a special case of one that does.

    Args:
        name: the effect.
    """
    entry = effect(name)
    return entry.is_contact_law or (entry.special_case_of != "" and effect(entry.special_case_of).is_contact_law)


def is_drag(name: str) -> bool:
    """Return whether an effect that could describe another contact law is a force of the velocity alone beside it.

    Args:
        name: the effect.
    """
    entry = effect(name)
    return is_contact_law(name) and entry.place is Place.ADDED_FORCE and entry.coordinates == ("velocity",)


def is_inertial(name: str) -> bool:
    """Return whether the force of an effect is that of a mass, which is a force beside any contact.

    Args:
        name: the effect.
    """
    return effect(name).added_mass != 0.0


def is_built_in(name: str) -> bool:
    """Return whether an effect is the package's own.

    Args:
        name: its name.
    """
    return any(entry.name == name for entry in BUILT_IN)


def register(entry: Effect) -> None:
    """Add a user's effect to the catalogue; the same effect again replaces the former.

    Args:
        entry: the effect.

    Raises:
        ConfigurationError: when the name is the package's own, or the place is not open to users.
    """
    if is_built_in(entry.name):
        raise ConfigurationError([f"effect {entry.name} is already in the catalogue; give yours another name"])
    if entry.place not in USER_PLACES:
        raise ConfigurationError(
            [
                f"effect {entry.name} acts on {entry.place.value}; give it Place.ADDED_FORCE or Place.LEVEL_FACTOR, the"
                " places that a user's effect can have"
            ]
        )
    _effects[entry.name] = entry


def load_user_effects(files: Sequence[str | Path] = ()) -> tuple[str, ...]:
    """Register the effects of installed entry points and of Python files.

    A file (or the object an entry point of the group ``sgms_observer.effects`` names) holds ``EFFECTS``, a sequence
    of ``Effect``, or is one itself. Files and entry points already loaded are not executed again.

    Args:
        files: Python files, relative to the working directory or absolute.

    Returns:
        Names of the effects that were registered now.

    Raises:
        ConfigurationError: one sentence per file or entry point that cannot be used.
    """
    faults: list[str] = []
    added: list[str] = []
    for point in _installed():
        _load(f"entry point {point.name}", point.load, added, faults)
    for file in files:
        path = Path(file).expanduser().resolve()
        _load(f"effect file {path}", lambda path=path: _execute(path), added, faults)
    if faults:
        raise ConfigurationError(faults)
    return tuple(added)


@cache
def _installed() -> tuple[EntryPoint, ...]:
    """Return the entry points of this Python's packages; looking through all of them takes 15 ms."""
    return tuple(entry_points(group=ENTRY_POINT_GROUP))


def _load(label: str, read: Any, added: list[str], faults: list[str]) -> None:
    """Register what ``read()`` returns, or note one sentence; a user's file may raise anything."""
    if label in _loaded:
        return
    try:
        for entry in _effects_of(read(), label):
            register(entry)
            added.append(entry.name)
        _loaded.add(label)
    except ConfigurationError as error:
        faults.extend(f"{label}: {sentence}" for sentence in error.sentences)
    except Exception as error:  # the user's own code
        faults.append(f"{label} cannot be used: {type(error).__name__}: {error}; correct it")


def _execute(path: Path) -> Any:
    """Run a user's Python file and return its module."""
    if not path.is_file():
        raise ConfigurationError(["there is no such file; correct effect_files"])
    spec = importlib.util.spec_from_file_location(f"sgms_user_effects_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise ConfigurationError(["it is not a Python file; give one that ends in .py"])
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _effects_of(found: Any, label: str) -> Iterable[Effect]:
    """Return the effects in a module, a sequence or a single effect."""
    listed = getattr(found, "EFFECTS", found)
    entries = [listed] if isinstance(listed, Effect) else list(listed) if isinstance(listed, (list, tuple)) else []
    if not entries or not all(isinstance(entry, Effect) for entry in entries):
        raise ConfigurationError(["it has no EFFECTS, a list of sgms_observer.effects.effect.Effect; add it"])
    return entries
