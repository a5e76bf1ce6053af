"""Identification of random simulated tables: is what is told to be shown right, and is the held-out force at the floor?

    python benchmarks/identification.py [--tables 6] [--rate 10000] [--model sgms] [--json FILE]

Each table has its own friction, mass and controller, a 10 nm encoder with 5 nm noise and 0.1 N force noise. It follows
the reference of ``sgms excite --for identify`` once to learn and once, with other noise, to judge. The floor is the
force error that the true parameters leave on the judging recording. Everything printed is computed in the run.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from sgms_observer.excitation.limits import ExcitationLimits
from sgms_observer.excitation.reference import design_excitation
from sgms_observer.identification.effect_terms import EffectTerms
from sgms_observer.identification.identify import Identification, IdentifyOptions, identify
from sgms_observer.identification.prepared import prepare_all
from sgms_observer.identification.problem import (
    DELAY,
    ELEMENTS,
    MASS,
    OFFSET,
    RATE,
    RHO,
    V_S,
    VISCOUS,
    ElementShape,
    Parameters,
    residual_and_jacobian,
)
from sgms_observer.offline.recording import Recording, recordings_from_samples
from sgms_observer.settings.axis import (
    AxisSettings,
    ControllerSettings,
    EffectSettings,
    EncoderSettings,
    FrictionSettings,
    ReferenceSettings,
    Settings,
    StageSettings,
)
from sim_plant.reference_file import write_reference_file
from sim_plant.table import SimulatedTable

TICK = 1.0e-4  # s; the controller runs this often, whatever is recorded
START = AxisSettings(
    mass=7.0,
    friction=FrictionSettings(
        element_stiffness=(5.0e6, 2.0e6, 1.0e6),
        element_fraction=(0.2, 0.2, 0.6),
        element_damping=(0.0, 0.0, 0.0),
        viscous_coefficient=5.0,
        static_force=3.3,
        coulomb_force=3.0,
        stribeck_velocity=4.0e-3,
    ),
)


def random_table(number: int, model: str) -> AxisSettings:
    """Return a table with its own truth; number 0 is Table I of the paper."""
    rng = np.random.default_rng([number, 5])
    base = FrictionSettings(model=model)
    if number == 0:
        friction, mass, offset, bandwidth = base, 10.0, -0.3, 100.0
    else:
        coulomb = 4.0 * rng.uniform(0.6, 1.6)
        count = int(rng.integers(2, 5))
        deflection = np.sort(np.geomspace(3.0e-8, 5.0e-6, count) * rng.uniform(0.7, 1.4, count))
        share = rng.uniform(0.05, 0.2, count)
        share[-1] = 1.0 - share[:-1].sum()
        friction = replace(
            base,
            element_stiffness=tuple(share * coulomb / deflection),
            element_fraction=tuple(share),
            element_damping=(0.0,) * count,
            coulomb_force=coulomb,
            static_force=coulomb * rng.uniform(1.05, 1.4),
            stribeck_velocity=1.0e-3 * 2.0 ** rng.uniform(-1.0, 2.0),
            viscous_coefficient=rng.uniform(5.0, 60.0),
            attraction_rate=50.0 * rng.uniform(0.7, 4.0),
        )
        mass, offset, bandwidth = rng.uniform(5.0, 20.0), rng.uniform(-1.0, 1.0), rng.uniform(60.0, 140.0)
    stage = StageSettings(
        controller=ControllerSettings(bandwidth=bandwidth, feedforward_mass=0.7),
        encoder=EncoderSettings(resolution=1.0e-8, noise=5.0e-9),
        force_noise=0.1,
    )
    effects = (EffectSettings("offset", (offset,)),)
    return AxisSettings(mass=mass, friction=friction, effects=effects, stage=stage)


def record(axis: AxisSettings, csv: Path, seed: int, duration: float, period: float) -> tuple[Recording, ...]:
    """Let a table follow a reference file."""
    stage = replace(axis.stage, reference=ReferenceSettings(kind="file", file=str(csv)), seed=seed)
    table = SimulatedTable(Settings(axes=(replace(axis, stage=stage),), sample_period=period), 1_000_000_000)
    return recordings_from_samples(table.step(round(duration / period))[0].samples, f"seed {seed}")


def truth(axis: AxisSettings) -> Parameters:
    """Return the true parameters; the effort is held over a tick of the controller, which delays it by half of one."""
    friction = axis.friction
    scalars = np.zeros(ELEMENTS)
    scalars[[MASS, VISCOUS]] = axis.mass, friction.viscous_coefficient
    scalars[[OFFSET, DELAY]] = axis.effects[0].values[0], TICK / 2
    scalars[[RHO, V_S]] = friction.static_force / friction.coulomb_force, friction.stribeck_velocity
    scalars[RATE] = friction.attraction_rate / friction.coulomb_force
    level = friction.coulomb_force * np.array(friction.element_fraction)
    return Parameters(scalars, np.array(friction.element_stiffness), level)


def force_error(
    recordings: Sequence[Recording],
    parameters: Parameters,
    axis: AxisSettings,
    model: str,
    cutoff: float,
) -> float:
    """Return the rms force error of given parameters on recordings [N].

    Args:
        recordings: evenly sampled pieces.
        parameters: the model; the true parameters give the floor.
        axis: smoothing.
        model: ``sgms`` or ``gms``.
        cutoff: corner of the low-pass [Hz].
    """
    total, rows = 0.0, 0
    for piece in prepare_all(recordings, cutoff, EffectTerms()):
        mask = piece.settled(float(parameters.slip_deflection.max()))
        residual, _jacobian = residual_and_jacobian(piece, parameters, ElementShape.of(axis.friction, model))
        total += float(residual[mask] @ residual[mask])
        rows += int(mask.sum())
    return float(np.sqrt(total / rows))


def judge(number: int, model: str, period: float, cutoff: float) -> dict[str, Any]:
    """Identify one table and compare with its truth."""
    axis = random_table(number, model)
    with tempfile.TemporaryDirectory() as folder:
        csv = Path(folder) / "reference.csv"
        reference = design_excitation(START, ExcitationLimits(0.02, 0.05, 1.0), ("identify",), rate=1.0 / period)
        write_reference_file(csv, reference.time, reference.position, reference.velocity)
        learn = record(axis, csv, 10 + number, float(reference.time[-1]), period)
        held_out = record(axis, csv, 1000 + number, float(reference.time[-1]), period)
    begun = time.perf_counter()
    result = identify(learn, START, IdentifyOptions(model=model, cutoff=cutoff))
    seconds = time.perf_counter() - begun
    true = truth(axis)
    floor = force_error(held_out, true, START, model, result.cutoff)
    error = force_error(held_out, result.parameters, START, model, result.cutoff)
    rows_out = compare(result, true)
    print(
        f"\ntable {number}: {len(true.kappa)} elements, {result.parameters.count} found; {seconds:.0f} s;"
        f" held-out force error {error:.4f} N, floor {floor:.4f} N, ratio {error / floor:.3f}"
    )
    for row in rows_out:
        verdict = "shown" if row["shown"] else "not shown"
        print(
            f"  {row['name']:24s} {row['estimate']:12.5g} true {row['true']:12.5g} error {row['error_percent']:7.2f} %"
            f" interval +- {row['half_width_percent']:6.2f} %  {verdict}"
        )
    return {"table": number, "ratio": error / floor, "rows": rows_out, "found": result.parameters.count,
            "true_count": len(true.kappa)}  # fmt: skip


def compare(result: Identification, true: Parameters) -> list[dict[str, Any]]:
    """Return one row per parameter; single elements only where their number is right."""
    estimate, sure = result.parameters.vector(), result.confidence
    names = result.parameters.names()
    if result.parameters.count == true.count:
        target = true.vector()
        chosen = list(range(len(names)))
    else:
        target = np.full(len(names), np.nan)
        target[:ELEMENTS] = true.scalars
        chosen = list(range(ELEMENTS))
    rows = []
    for index in chosen:
        if index == DELAY or (index == RATE and result.model != "gms") or index in result.frozen:
            continue
        scale = abs(target[index])
        if index == OFFSET:
            scale = max(scale, 0.4 * float(true.level.sum()))  # 5 % of this is 2 % of the Coulomb force
        rows.append(
            {
                "name": names[index],
                "estimate": float(estimate[index]),
                "true": float(target[index]),
                "error_percent": float(100.0 * (estimate[index] - target[index]) / scale),
                "half_width_percent": float(100.0 * sure.half_width[index] / scale),
                "shown": bool(sure.is_identifiable[index]),
            }
        )
    total, true_total = float(result.parameters.level.sum()), float(true.level.sum())
    error = 100.0 * (total / true_total - 1.0)
    rows.append(
        {
            "name": "coulomb_force",
            "estimate": total,
            "true": true_total,
            "error_percent": error,
            "half_width_percent": 100.0 * sure.coulomb_half_width / true_total,
            "shown": sure.coulomb_half_width <= 0.05 * total,
        }
    )
    return rows


def main() -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tables", type=int, default=6)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--rate", type=float, default=10_000.0, help="samples per second of the recordings [Hz]")
    parser.add_argument("--cutoff", type=float, default=0.0, help="corner of the low-pass [Hz]; 0 for the default")
    parser.add_argument("--model", choices=("sgms", "gms"), default="sgms")
    parser.add_argument("--json", metavar="FILE")
    args = parser.parse_args()
    numbers = range(args.first, args.first + args.tables)
    tables = [judge(number, args.model, 1.0 / args.rate, args.cutoff) for number in numbers]
    shown = [row for table in tables for row in table["rows"] if row["shown"]]
    inside = [row for row in shown if abs(row["error_percent"]) <= 5.0]
    told = [row for table in tables for row in table["rows"]]
    covered = [row for row in told if abs(row["error_percent"]) <= row["half_width_percent"]]
    with_interval = [row for row in told if np.isfinite(row["half_width_percent"])]
    worst = max(tables, key=lambda table: table["ratio"])
    right = sum(table["found"] == table["true_count"] for table in tables)
    print(f"\n{len(tables)} tables, {args.rate:g} Hz, model {args.model}, noise seeds 10.. (learn) and 1000.. (judge)")
    print(f"  number of elements right in {right} of {len(tables)}")
    print(f"  told to be shown: {len(shown)} of {len(told)} parameters; within 5 %: {len(inside)} of {len(shown)}")
    print(f"  95 % intervals that hold the truth: {len(covered)} of {len(with_interval)}")
    print(f"  held-out force error over its floor: at most {worst['ratio']:.3f} (table {worst['table']})")
    if args.json:
        Path(args.json).write_text(json.dumps(tables, indent=1), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
