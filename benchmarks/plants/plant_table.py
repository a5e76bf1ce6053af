"""The table of the benchmark: one column per plant, and one over all of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from statistics import median

from plant_score import NAMING, Score

from sim_plant.blind.table import count

ALL = "all"


def lower_tenth(values: Sequence[float]) -> float:
    """Return the value that a tenth of ``values`` do not exceed.

    Args:
        values: any numbers, at least one.
    """
    ordered = sorted(values)
    return ordered[max(0, int(0.1 * len(ordered) + 0.5) - 1)]


def _share(flags: Sequence[bool]) -> str:
    share = count(list(flags))
    return f"{100.0 * share.value:.0f} % ({share.hits}/{share.total})" if share.total else "-"


def _reduced(values: Sequence[float], reduce: Callable[[Sequence[float]], float], form: str = "{:.2f}") -> str:
    return form.format(reduce(values)) if values else "-"


def closures(scores: Sequence[Score]) -> list[float]:
    """Return closures of what the catalogue knows, where something was closable and a name was given.

    Args:
        scores: any.
    """
    return [
        one.closure for one in scores
        if one.effect and one.is_inside and one.verdict in NAMING and one.closure is not None
    ]  # fmt: skip


def _right_first(is_small: bool, is_above_noise: bool = False) -> Callable[[Sequence[Score]], str]:
    """Return how the right first names of the effects of one size are counted.

    Args:
        is_small: 5 % instead of 10-25 %.
        is_above_noise: whether only those count whose force is above the noise.
    """
    return lambda scores: _share(
        [
            one.is_right_first
            for one in scores
            if one.effect and one.is_inside and one.is_small == is_small and one.is_above_noise >= is_above_noise
        ]
    )


Line = tuple[str, str, Callable[[Sequence[Score]], str]]
LINES: tuple[Line, ...] = (
    ("cases", "", lambda s: str(len(s))),
    ("failed (no result.json)", "0", lambda s: str(sum(one.has_failed for one in s))),
    (
        "false alarms, nothing hidden: names, or an unknown effect that held-out data do not bear out",
        "<= 5 %",
        lambda s: _share([one.is_alarm and not one.is_borne_out for one in s if not one.effect]),
    ),
    (
        "... not counted: an unknown effect with nothing hidden whose learnt term closes held-out data",
        "",
        lambda s: str(sum(one.is_alarm and one.is_borne_out for one in s if not one.effect)),
    ),
    (
        "... of these, names that the contact law makes true",
        "",
        lambda s: str(sum(one.is_alarm and one.is_of_contact for one in s if not one.effect)),
    ),
    (
        "gap before, nothing hidden, median [% of rms effort]",
        "",
        lambda s: _reduced([one.before for one in s if not one.effect and one.before is not None], median, "{:.1f}"),
    ),
    ("right name first, 10-25 %", ">= 90 %", _right_first(is_small=False)),
    ("... whose force is above the noise of the held-out recording", "", _right_first(False, is_above_noise=True)),
    ("right name first, 5 %", ">= 70 %", _right_first(is_small=True)),
    ("... whose force is above that noise", "", _right_first(True, is_above_noise=True)),
    (
        "truth in the set, where something is named",
        ">= 95 %",
        lambda s: _share([one.is_in_set for one in s if one.effect and one.is_inside and one.verdict in NAMING]),
    ),
    ("confidently wrong", "<= 3 %", lambda s: _share([one.is_wrong for one in s])),
    ("names whose held-out gap did not shrink", "0", lambda s: str(sum(one.not_shrunk for one in s))),
    ("... cases whose gap shrank by less than its interval", "0", lambda s: str(sum(one.is_unsure for one in s))),
    (
        "outside the catalogue: told as unknown",
        ">= 85 %",
        lambda s: _share([one.is_told_unknown for one in s if one.effect and not one.is_inside]),
    ),
    (
        "... repeatable ones: told as unknown and closed to 0.5",
        ">= 85 %",
        lambda s: _share(
            [
                one.is_told_unknown and one.closure_by_maps is not None and one.closure_by_maps >= 0.5
                for one in s
                if one.effect and not one.is_inside and one.is_repeatable
            ]
        ),
    ),
    (
        "... not repeatable ones: nothing named",
        "",
        lambda s: _share([one.verdict not in NAMING for one in s if one.effect and not one.is_repeatable]),
    ),
    ("closure, median", ">= 0.9", lambda s: _reduced(closures(s), median)),
    ("closure, worst tenth", ">= 0.6", lambda s: _reduced(closures(s), lower_tenth)),
    ("90 % intervals cover", "85-95 %", lambda s: _share([flag for one in s for flag in one.covered])),
    (
        "time of one process, median [s]",
        "",
        lambda s: _reduced([one.seconds for one in s if one.seconds == one.seconds], median, "{:.0f}"),
    ),
    (
        "time of one process, longest [s]",
        "",
        lambda s: _reduced([one.seconds for one in s if one.seconds == one.seconds], max, "{:.0f}"),
    ),
    (
        "memory, largest [MB]",
        "<= 1000",
        lambda s: _reduced([one.memory for one in s if one.memory == one.memory], max, "{:.0f}"),
    ),
)
"""Name, what is to be reached, and how it is counted."""


def table_text(scores: Sequence[Score]) -> str:
    """Return the table in Markdown: a column per plant, then one over all.

    Args:
        scores: of all cases that ran.
    """
    plants = list(dict.fromkeys(one.plant for one in scores))
    columns = [[one for one in scores if one.plant == plant] for plant in plants] + [list(scores)]
    rows = [
        "| figure | to reach | " + " | ".join([*plants, ALL]) + " |",
        "|---|---|" + "---|" * len(columns),
    ]
    for name, goal, value in LINES:
        rows.append(f"| {name} | {goal} | " + " | ".join(value(column) for column in columns) + " |")
    return "\n".join(rows)


def effects_text(scores: Sequence[Score]) -> str:
    """Return, in Markdown, what was said of each hidden effect.

    Args:
        scores: of all cases that ran.
    """
    groups: dict[tuple[str, str], list[Score]] = {}
    for one in scores:
        size = "-" if not one.effect else "5 %" if one.is_small else "10-25 %"
        groups.setdefault((one.effect or "nothing", size), []).append(one)
    rows = [
        "| hidden | size | cases | right first | in the set | said instead | closure, median |",
        "|---|---|---|---|---|---|---|",
    ]
    for (effect, size), group in sorted(groups.items()):
        said: dict[str, int] = {}
        for one in group:
            if not one.is_right_first:
                key = f"{one.first} ({one.plant})"
                said[key] = said.get(key, 0) + 1
        text = ", ".join(f"{word} {number}" for word, number in sorted(said.items(), key=lambda item: -item[1]))
        closed = _reduced([one.closure for one in group if one.closure is not None], median)
        right, inside = sum(one.is_right_first for one in group), sum(one.is_in_set for one in group)
        rows.append(f"| {effect} | {size} | {len(group)} | {right} | {inside} | {text} | {closed} |")
    return "\n".join(rows)
