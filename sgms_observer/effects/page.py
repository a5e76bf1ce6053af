"""``docs/catalogue.md``, written from the catalogue: ``python -m sgms_observer.effects.page docs/catalogue.md``."""

from __future__ import annotations

import sys
from pathlib import Path

from sgms_observer.effects.catalogue import BUILT_IN
from sgms_observer.effects.effect import Effect, EffectList, EffectParameter, Place

_MORE_MAPS = ("learnt_map_2", "learnt_map_3")  # as learnt_map, for more than one table

_HEAD = """# The catalogue of effects

Written by `python -m sgms_observer.effects.page docs/catalogue.md`; do not edit. Name any of these in the YAML's
`x.effects.names`; the balance of forces is then

    arrived effort = (mass + added mass) * acceleration + friction(factor * s(v)) + added force

with q position [m], v velocity [m/s], a acceleration [m/s^2], t time since the first sample [s], s the Stribeck
level [N]. A strength at its default means: no effect. Bounds are checked at start.

Effects of your own: a Python file with `EFFECTS = [Effect(...)]` (see `sgms_observer/effects/effect.py`), named in
`effect_files` of the YAML, or given by an installed package's entry point in the group `sgms_observer.effects`.
Formulas are plain functions over `math`, arguments by name out of q, v, a, t, u, h, level, v2, a2, s, p.

A learnt map (`learnt_map`, and for more than one also `learnt_map_2`, `learnt_map_3`) holds its table in the parameter
file, here friction along a rail, larger downwards:

```yaml
      effects:
        names: [learnt_map]
        learnt_map:
          coordinates: [position, direction]           # one or two
          position: [0.0, 0.2, 0.4]                    # m, the grid; the grid of direction is -1, 1
          values: [-2.3, 2.3, -6.1, 4.0, -3.0, 2.5]    # N, the last coordinate fastest: both at 0.0 m, ...
```

Between grid points the force is linear. Outside the grid it fades to zero within a tenth of the grid's range, because
nothing was recorded there. So it is bounded by its largest value. The direction reverses over `reversal_distance` and
does not change at rest, so the noise of a resting encoder has no effect; the compensation computes it along the
reference. `dwell` counts the time at rest before the present motion. In Python,
`sgms_observer.effects.learnt_map.LearntMap` makes, evaluates and fits such maps.

How each place is used: an **added force** and a **level factor** act in the stage, the observer (the force is
subtracted from the measured friction, the factor scales the model's Stribeck curve), replay and compensation. The
**effort's path** converts the published effort to the effort on the mass, before any other use. The simulated stage
adds a **measured position** effect to the true position, and the observer subtracts it from the measured one. **Plant**
effects change the mass (`added_mass`); a flexible mode also has the deflection of the attached mass as a state, driven
by the acceleration of the carriage.
"""


def catalogue_page() -> str:
    """Return the page as Markdown."""
    parts = [_HEAD]
    for place in Place:
        parts.append(f"\n## {place.value[0].upper()}{place.value[1:]}\n")
        parts.extend(_section(entry) for entry in BUILT_IN if entry.place is place and entry.name not in _MORE_MAPS)
    return "\n".join(parts)


def _row(parameter: EffectParameter) -> str:
    """Return the table's row of one parameter."""
    bounds = f"{parameter.minimum:g} .. {parameter.maximum:g}"
    kind = " (strength)" if parameter.is_strength else ""
    default = f"{parameter.default:g}"
    if parameter.prismatic_default is not None:
        default += f"; {parameter.prismatic_default:g} on a prismatic axis"
    return f"| `{parameter.name}` | {parameter.unit} | {default} | {bounds} | {parameter.description}{kind} |"


def _list_row(item: EffectList) -> str:
    """Return the table's row of a parameter that is a list."""
    bounds = ", ".join(item.choices) if item.choices else f"{item.minimum:g} .. {item.maximum:g} each"
    default = ", ".join(entry if isinstance(entry, str) else f"{entry:.12g}" for entry in item.default)
    return f"| `{item.name}` | {item.unit} | [{default}] | {bounds} | {item.description} (list) |"


def _section(entry: Effect) -> str:
    """Return the section of one effect."""
    rows = "\n".join([*map(_row, entry.parameters), *map(_list_row, entry.lists)])
    over = f" Lies over: {', '.join(entry.coordinates)}." if entry.coordinates else ""
    confused = ", ".join(entry.confusable_with) or "nothing in particular"
    case = f" A special case of {entry.special_case_of}." if entry.special_case_of else ""
    return (
        f"### {entry.name}\n\n`{entry.equation}`\n\n"
        f"Shows as: {entry.signature}. Needs: {entry.excitation}. Easily taken for: {confused}."
        f"{over}{case}\n\n"
        "| parameter | unit | default | bounds | meaning |\n|---|---|---|---|---|\n"
        f"{rows}\n\nSource: {entry.reference}.\n"
    )


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(catalogue_page(), encoding="utf-8")
