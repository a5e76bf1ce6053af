"""References of ``sgms excite`` against a fixed recipe, in the same time and limits.

    python benchmarks/excitation.py [--tables 4] [--first 0] [--pairs] [--time-share 1.0 0.5] [--json FILE]
                                    [--against commission]

The recipe is the one that ``sgms excite`` followed before and the design one for ``identify``; with ``--against
commission`` the recipe is the first recording of ``sgms commission``, and the design one for identify and diagnose.

Intervals: random tables (those of ``benchmarks/identification.py``, 0 is Table I of the paper) follow both references,
made from the same wrong start file, at 1 kHz with encoder steps, noise and their own controllers. ``identify`` runs on
both recordings as users run it; elements are compared where both find the right number of them. The list
shows the half 95 % interval of each parameter under the recipe over that under the design: above 1 the design is
better. A parameter that only one of them finds counts as not comparable.

Pairs (``--pairs``): one effect acts in the simulated stage; the evidence for it against a rival is by how much the
whitened squared residual is larger when the rival is refitted in its place, with all friction parameters free within
their tolerance. Diagnosis follows identification: here the design knows the table's friction, but no effect.

Nothing that is reported was used to choose how designs are made. Everything printed is computed in the run.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
sys.path.insert(0, str(Path(__file__).resolve().parent))

from excitation_recipe import build_recipe
from identification import START, compare, random_table, record, truth

from sgms_observer.application.commission.learn import MAX_RECORD_TIME, largest_deflection
from sgms_observer.application.commission.motion import learning_motion
from sgms_observer.arrays import Floats
from sgms_observer.diagnosis.fit import fixed_parameters, refit
from sgms_observer.diagnosis.model import Model
from sgms_observer.diagnosis.motion import motion_of
from sgms_observer.diagnosis.whitened import data_with_own_noise
from sgms_observer.excitation.limits import ExcitationLimits
from sgms_observer.excitation.reference import design_excitation
from sgms_observer.identification.identify import IdentifyOptions, identify
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.axis import AxisSettings, EffectSettings
from sim_plant.reference_file import write_reference_file

RATE = 1000.0  # Hz
LIMITS = ExcitationLimits(0.02, 0.05, 1.0)
TOLERANCE = 0.1  # of the owner's friction values when effects are told from each other
PAIRS = (
    (("cogging", (0.4, 0.008, 0.5, 0.0, 0.0)), ("position_periodic_friction", (0.1, 0.008, 0.5))),
    (("cogging", (0.4, 0.008, 0.5, 0.0, 0.0)), ("position_dependent_friction", (0.1, 0.0, 0.004))),
    (("position_dependent_friction", (0.15, 0.003, 0.003)), ("spring", (20.0, 0.0))),
    (("offset", (0.4,)), ("asymmetric_coulomb", (0.1,))),
    (("quadratic_drag", (200.0,)), ("nonlinear_viscous", (0.3, 0.6, 0.05))),
    (("dwell_breakaway", (0.15, 0.3, 2.0e-5, 1.0e-4)), ("stribeck", (0.1, 5.0e-3))),
)
"""An effect that acts, and the rival that could be taken for it; forces about a tenth of the Coulomb force."""


def followed_by(axis: AxisSettings, position: Floats, seed: int) -> tuple[Recording, ...]:
    """Let a table follow a reference."""
    period = 1.0 / RATE
    with tempfile.TemporaryDirectory() as folder:
        csv = Path(folder) / "reference.csv"
        write_reference_file(csv, period * np.arange(len(position)), position, np.gradient(position, period))
        return record(axis, csv, seed, period * (len(position) - 1), period)


def widths_of(number: int, position: Floats) -> dict[str, float]:
    """Return half the 95 % interval of each parameter that identification finds [%]."""
    axis = random_table(number, "sgms")
    true = truth(axis)
    result = identify(followed_by(axis, position, 10 + number), START, IdentifyOptions("sgms"))
    rows = compare(result, true)
    return {row["name"]: row["half_width_percent"] for row in rows if np.isfinite(row["half_width_percent"])}


def compare_intervals(numbers: range, recipe: Floats, designs: dict[float, Floats]) -> list[dict[str, Any]]:
    """Print and return the ratio of the intervals for each table and each share of the recipe's time."""
    out = []
    for number in numbers:
        before = widths_of(number, recipe)
        for share, designed in designs.items():
            after = widths_of(number, designed)
            ratios = {name: before[name] / after[name] for name in before if name in after}
            mean = float(np.exp(np.mean(np.log(list(ratios.values())))))
            lost, won = sorted(set(before) - set(after)), sorted(set(after) - set(before))
            print(f"\ntable {number}: intervals {mean:.2f} times narrower in {share:g} times the time")
            for name, ratio in ratios.items():
                widths = f"recipe +- {before[name]:7.2f} %, design +- {after[name]:7.2f} %"
                print(f"  {name:24s} {widths}: {ratio:5.2f} times")
            print(f"  found with the recipe only: {lost or 'none'}; with the design only: {won or 'none'}", flush=True)
            out.append({"table": number, "share": share, "mean": mean, "ratios": ratios, "lost": lost, "won": won})
    return out


def evidence(acting: EffectSettings, rival: EffectSettings, position: Floats) -> float:
    """Return by how much the rival leaves more of the whitened squared residual than the effect that acts."""
    table = random_table(0, "sgms")
    owner = replace(table, effects=(EffectSettings("offset", table.effects[0].values),))
    stage = replace(table, effects=(*owner.effects, acting)) if acting.name != "offset" else replace(
        table, effects=(EffectSettings("offset", (table.effects[0].values[0] + acting.values[0],)),)
    )  # fmt: skip
    recordings = followed_by(stage, position, 77)
    motions = [motion_of(one) for one in recordings]
    nominal = Model.of(owner)
    judged = data_with_own_noise(motions, Model.of(stage))
    costs = []
    for item in (acting, rival):
        found = refit(judged, nominal, TOLERANCE, [item], None, fixed_parameters([item]))
        costs.append(2.0 * found.cost)
    return costs[1] - costs[0]


def learning_reference() -> Floats:
    """Return the first motion that ``sgms commission`` makes from the wrong start file."""
    presliding = largest_deflection(START.friction)
    return learning_motion(LIMITS, 1.0 / RATE, presliding, START.friction.stribeck_velocity, MAX_RECORD_TIME).position


def compare_pairs(recipe: Floats, is_for_all: bool) -> list[dict[str, Any]]:
    """Print and return the evidence of each pair under the recipe and under a design, for it or for all effects."""
    out = []
    seconds = (len(recipe) - 1) / RATE
    table = random_table(0, "sgms")
    for acting, rival in ((EffectSettings(*one), EffectSettings(*other)) for one, other in PAIRS):
        asked = () if is_for_all else (acting.name, rival.name)
        design = design_excitation(START if is_for_all else table, LIMITS, asked, 0.0, seconds, RATE)
        before, after = (evidence(acting, rival, position) for position in (recipe, design.position))
        print(
            f"{acting.name} against {rival.name}: chi2 distance {before:.0f} with the recipe, {after:.0f} with the"
            f" design, {after / max(before, 1.0):.1f} times",
            flush=True,
        )
        out.append({"acting": acting.name, "rival": rival.name, "recipe": before, "design": after})
    return out


def main() -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tables", type=int, default=4)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument(
        "--time-share", type=float, nargs="+", default=[1.0], help="time of the design over that of the recipe"
    )
    parser.add_argument("--pairs", action="store_true", help="evidence between pairs of effects instead of intervals")
    parser.add_argument(
        "--against", choices=("recipe", "commission"), default="recipe", help="which fixed motion to compare with"
    )
    parser.add_argument("--json", metavar="FILE")
    args = parser.parse_args()
    is_commission = args.against == "commission"
    recipe = learning_reference() if is_commission else build_recipe(START, LIMITS, 1.0 / RATE)
    seconds = (len(recipe) - 1) / RATE
    print(f"recipe: {seconds:.2f} s, stroke {np.ptp(recipe) * 1e3:.1f} mm")
    if args.pairs:
        result: Any = compare_pairs(recipe, is_commission)
    else:
        designs = {}
        for share in args.time_share:
            asked = () if is_commission else ("identify",)
            design = design_excitation(START, LIMITS, asked, 0.0, share * seconds, RATE)
            print("\n".join((*design.summary, *design.warnings)))
            designs[share] = design.position
        result = compare_intervals(range(args.first, args.first + args.tables), recipe, designs)
        for share in designs:
            means = [table["mean"] for table in result if table["share"] == share]
            mean = float(np.exp(np.mean(np.log(means))))  # geometric
            print(f"\n{len(means)} tables: {mean:.2f} times narrower in {share:g} times the time (geometric mean)")
    if args.json:
        Path(args.json).write_text(json.dumps(result, indent=1), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
