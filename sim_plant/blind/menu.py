"""The menu: every effect that can be hidden, by name, and two of them together."""

from __future__ import annotations

from collections.abc import Callable

from sim_plant.blind import force_effects, friction_effects, outside_effects, path_effects
from sim_plant.blind.hidden_effect import Around, Floats, Hidden, Kind, Series

NOTHING = "nothing"
"""Name of a case with nothing hidden."""

KINDS: dict[str, Kind] = {
    kind.name: kind
    for kind in (*force_effects.KINDS, *friction_effects.KINDS, *path_effects.KINDS, *outside_effects.KINDS)
}
INSIDE = tuple(name for name, kind in KINDS.items() if kind.is_inside)
"""Effects the catalogue has a name for."""
OUTSIDE = tuple(name for name, kind in KINDS.items() if not kind.is_inside)
"""Effects it has none for."""
PAIRS = (
    ("cogging", "asymmetric_coulomb"),
    ("cogging", "actuator_delay"),
    ("position_periodic_friction", "asymmetric_viscous"),
    ("position_dependent_friction", "quadratic_drag"),
    ("spring", "stribeck"),
    ("spring", "thermal_drift"),
    ("offset", "eddy_current"),
    ("periodic_disturbance", "position_dependent_friction"),
    ("flexible_mode", "cogging"),
    ("wear_step", "asymmetric_coulomb"),
    ("actuator_dead_zone", "spring"),
    ("thermal_drift", "cogging"),
    ("presliding", "offset"),
    ("load_dependent_friction", "periodic_disturbance"),
)
"""Effects that are hidden together: no two of one pair are confusable with each other."""


def names(effect: str) -> tuple[str, ...]:
    """Return the effects in ``effect``: none, one, or two joined by ``+``.

    Raises:
        ValueError: for a name that is not on the menu.
    """
    if effect == NOTHING:
        return ()
    parts = tuple(effect.split("+"))
    strange = [part for part in parts if part not in KINDS]
    if strange:
        raise ValueError(
            f"hidden effect {strange[0]!r} is not on the menu; use {NOTHING}, {', '.join(KINDS)}, or two joined by +"
        )
    return parts


def together(first: Hidden, second: Hidden) -> Hidden:
    """Return both effects in one plant; ``second`` was drawn for the stage of ``first``."""

    def both(one: Series | None, other: Series | None, join: Callable[[Floats, Floats], Floats]) -> Series | None:
        if one is None or other is None:
            return one or other
        left, right = one, other

        def series(around: Around) -> Floats:
            return join(left(around), right(around))

        return series

    return Hidden(
        known=first.known,
        true=second.true if second.true is not second.known else first.true,
        slots=first.slots | second.slots,
        force=both(first.force, second.force, lambda a, b: a + b),
        level=both(first.level, second.level, lambda a, b: a * b),
        viscous=both(first.viscous, second.viscous, lambda a, b: a * b),
    )
