"""The reference page of all parameters, written from their declarations.

``python -m sgms_observer.settings.document`` writes ``docs/parameters.md``; a test holds the page against this.
"""

from __future__ import annotations

import sys
from pathlib import Path

from sgms_observer.errors import SgmsError
from sgms_observer.settings.axis import AxisSettings, Settings
from sgms_observer.settings.check import shown
from sgms_observer.settings.declaration import Declared, declared_sections, declared_settings
from sgms_observer.settings.load import AXES
from sgms_observer.whole_file import write_text

PAGE = Path("docs") / "parameters.md"

_HEAD = """# Parameters

Written by `python -m sgms_observer.settings.document` from the declarations in `sgms_observer/settings/`; do not edit.

A parameter file is ROS 2 YAML and serves the nodes and the command line alike; `config/table.yaml` is the one to start
from. `/**` is for every node; a section of one node, such as `/observer_node`, overrides it. Everything has a
default. A key that is not listed here, a wrong type or an impossible value stops the start with one sentence each.

```yaml
/**:
  ros__parameters:
    axes: [x]
    sample_period: 1.0e-4
    x:
      mass: 10.0
      friction: {static_force: 4.5, coulomb_force: 4.0}
```

Numbers may be written as `3`, `3.0` or `3e0`. Relative file names start at the folder of the parameter file. All
parameters are read at the start: change the file, or use `-p x.mass:=12.0`, and start again. The compensation's
may change while the node runs: `ros2 param set /observer_node x.compensation.gain 0.5`; magnitudes to at most ten
times what the node started with.
"""

_EFFECTS = """
## Effects: `x.effects`

`names` lists effects of the catalogue; each has a group of that name with its parameters, units and bounds as
`docs/catalogue.md` gives them:

```yaml
      effects:
        names: [cogging, offset]
        cogging: {amplitude: 1.4, pitch: 0.010, phase: 0.3}
        offset: {force: 0.5}
```

A `learnt_map` (and `learnt_map_2`, `learnt_map_3`) holds a table of forces as lists. `effect_files` adds effects of
your own to the catalogue.

## Units of a revolute axis

The tables give the units of a prismatic axis. `joint_type: revolute` makes each `m` a `rad`, `N` a `N m` and `kg` a
`kg m^2`: N/m is N m/rad, N s/m is N m s/rad. Everything but the two scales is in these units; `position_scale` and
`effort_scale` convert topics and bags to these units, and all outputs are in them.

## The truth of the simulated stage: `x.stage.friction`, `x.stage.effects`

Both are optional. `x.stage.friction` holds those keys of `x.friction` that differ for the simulated stage, for instance
`{model: gms}`. `x.stage.effects` replaces `x.effects`; `names: [none]` is a stage without any.

## Between parameters

- `element_stiffness`, `element_fraction` and `element_damping` have one entry per element; without `element_damping` it
  is zero. The fractions sum to 1 (within 0.001).
- `static_force` is at least `coulomb_force`.
- `multi_sine` has as many `amplitudes` as `frequencies`, and as many `phases` or none; `file` names a CSV file.
- Frequencies, the controller's bandwidth and the low-pass's cut-off stay below half the sample rate.
- `filter.window` spans at least 2 (degree div 2 + 1) sample periods, to which it stretches if left at its default, and
  at most 10000.
- `filter.maximum_gap` is at least two sample periods, `compensation.timeout` more than one.
- `parameter_minimum` is below 1 and `parameter_maximum` above it.
"""


def page() -> str:
    """Return the text of ``docs/parameters.md``."""
    shared = {"axes": AXES, **declared_settings(Settings)}
    parts = [_HEAD, _table("For all axes", shared), _table("One axis: `x`", declared_settings(AxisSettings))]
    parts += _groups("x", AxisSettings)
    return "\n".join(parts) + _EFFECTS


def _groups(path: str, kind: type) -> list[str]:
    """Return the tables of the groups inside a group."""
    parts = []
    for key, (nested, description) in declared_sections(kind).items():
        name = f"{path}.{key}"
        parts.append(_table(f"{description[0].upper()}{description[1:]}: `{name}`", declared_settings(nested)))
        parts += _groups(name, nested)
    return parts


def _table(title: str, settings: dict[str, Declared]) -> str:
    """Return one group as a table."""
    rows = [f"## {title}\n", "| parameter | type | default | unit | allowed | meaning |", "|---|---|---|---|---|---|"]
    for key, declared in settings.items():
        value = list(declared.default) if isinstance(declared.default, tuple) else declared.default
        default = '""' if value == "" else value if isinstance(value, str) else shown(value).replace("'", "")
        kind = declared.kind.replace("_array", " list")
        rule = _allowed(declared)
        rows.append(f"| `{key}` | {kind} | {default} | {declared.unit} | {rule} | {declared.description} |")
    return "\n".join(rows) + "\n"


def _allowed(declared: Declared) -> str:
    """Return the rule for a value."""
    if declared.choices:
        return ", ".join(declared.choices)
    rules = []
    if declared.minimum is not None:
        rules.append(f">= {shown(declared.minimum)}")
    if declared.maximum is not None:
        rules.append(f"<= {shown(declared.maximum)}")
    if declared.is_nonzero:
        rules.append("not 0")
    return ", ".join(rules) or "any"


def main() -> int:
    """Write the page into the ``docs`` folder below the current one."""
    try:
        write_text(page(), PAGE)
    except SgmsError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
