"""The plainest check of ``sgms diagnose``: hide one catalogue effect in the simulated stage, excite, diagnose.

    python benchmarks/diagnosis.py --out out/diagnosis        # every effect on config/table.yaml, S-GMS
    python benchmarks/diagnosis.py --model gms --only cogging,offset
    python benchmarks/diagnosis.py --motion multi_sine          # a poor motion: no wrong name allowed

Everything goes through the commands a user has: ``excite``, ``simulate``, ``diagnose`` with a point-to-point recording
held out. The truth's friction is the model's own: the effect is all that is missing. Sizes are about 15 % of the
Coulomb force.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from sgms_observer.cli.main import main as sgms

ROOT = Path(__file__).resolve().parent.parent
PERIOD = 1.0e-3  # s
HELD_OUT = 15.0  # s
POOR = 20.0  # s

HIDDEN: dict[str, dict[str, float]] = {
    "nothing": {},
    "cogging": {"amplitude": 0.6, "pitch": 0.010, "phase": 0.3},
    "position_periodic_friction": {"share": 0.15, "pitch": 0.010, "phase": 0.3},
    "position_dependent_friction": {"share": 0.25, "center": 0.005, "width": 0.004},
    "spring": {"stiffness": 30.0, "rest_position": 0.002},
    "offset": {"force": 0.6},
    "asymmetric_coulomb": {"share": 0.15},
    "asymmetric_viscous": {"coefficient": 12.0},
    "stribeck": {"share": 0.2, "velocity": 0.008},
    "nonlinear_viscous": {"force": 0.8, "exponent": 0.4, "reference_velocity": 0.05},
    "quadratic_drag": {"coefficient": 300.0},
    "eddy_current": {"peak_force": 0.8, "peak_velocity": 0.012},
    "presliding": {"force": 0.6, "distance": 1.0e-4},
    "backlash": {"gap": 5.0e-5, "share": 0.3},
    "dwell_breakaway": {"share": 0.3, "dwell_time": 0.3, "memory_distance": 1.0e-4},
    "frictional_lag": {"attraction_rate": 30.0, "distance": 1.0e-5},
    "thermal_drift": {"share": -0.25, "time_constant": 15.0},
    "wear_step": {"share": 0.15, "travel": 0.08, "width": 0.02},
    "load_dependent_friction": {"coefficient": 0.2},
    "mass_error": {"mass": 1.5},
    "flexible_mode": {"mass": 2.0, "frequency": 40.0, "damping_ratio": 0.05},
    "actuator_delay": {"delay": 1.5e-3},
    "actuator_gain": {"gain": 0.85},
    "actuator_saturation": {"limit": 12.0},
    "actuator_dead_zone": {"width": 0.6},
    "encoder_interpolation_error": {"amplitude": 2.0e-7, "pitch": 5.0e-4, "phase": 0.4},
    "quantisation": {"resolution": 1.0e-7},
    "periodic_disturbance": {"amplitude": 0.6, "frequency": 7.0, "phase": 0.2},
    "cross_axis_coupling": {"inertia": 1.0, "viscous": 4.0},
}


@dataclass(frozen=True)
class Outcome:
    """What one case gave.

    Attributes:
        name: what was hidden.
        first: first name, or the verdict.
        line: the case in one line.
        is_right: the hidden effect is named first (for a poor motion: nothing else is claimed without reserve).
    """

    name: str
    first: str
    line: str
    is_right: bool


def case_tree(base: str, model: str, name: str, reference: dict[str, Any] | None) -> dict[str, Any]:
    """Return a parameter file as a tree: the base, a stage with the effect, and the motion.

    Args:
        base: ``table`` for config/table.yaml, ``default`` for the built-in defaults.
        model: ``sgms`` or ``gms``, of the model and of the truth.
        name: effect to hide in the stage.
        reference: settings of x.stage.reference.
    """
    if base == "table":
        tree = yaml.safe_load((ROOT / "config" / "table.yaml").read_text(encoding="utf-8"))
    else:
        encoder = {"resolution": 1.0e-9, "noise": 2.0e-9}
        axis: dict[str, Any] = {"friction": {}, "stage": {"encoder": encoder, "force_noise": 0.01}}
        tree = {"/**": {"ros__parameters": {"axes": ["x"], "x": axis}}}
    parameters = tree["/**"]["ros__parameters"]
    parameters["sample_period"] = PERIOD
    stage = parameters["x"].setdefault("stage", {})
    parameters["x"]["friction"]["model"] = model
    stage["friction"] = {"model": model}
    if reference is not None:
        stage["reference"] = reference
    if name != "nothing":
        stage["effects"] = {"names": [name], name: HIDDEN[name]}
    if "y" in parameters["axes"]:
        parameters["y"]["stage"]["reference"] = {"kind": "point_to_point", "amplitude": 0.01, "dwell": 0.35}
    return dict(tree)


@contextlib.contextmanager
def quiet() -> Iterator[io.StringIO]:
    """Keep what a command prints."""
    text = io.StringIO()
    with contextlib.redirect_stdout(text), contextlib.redirect_stderr(text):
        yield text


def command(*words: str) -> None:
    """Run one ``sgms`` command.

    Raises:
        RuntimeError: it did not end well.
    """
    with quiet() as text:
        code = sgms(list(words))
    if code != 0:
        raise RuntimeError(f"sgms {' '.join(words)}: {text.getvalue()}")


def write_yaml(tree: dict[str, Any], path: Path) -> str:
    """Write a parameter file and return its name."""
    path.write_text(yaml.safe_dump(tree), encoding="utf-8")
    return str(path)


def run_case(base: str, model: str, motion: str, name: str, out: Path, seed: int) -> Outcome:
    """Record, diagnose, and compare with the truth.

    Args:
        base, model, name: as in ``case_tree``.
        motion: ``excite``, or a kind of reference with its default settings.
        out: folder of the case.
        seed: of the stage's noise.
    """
    out.mkdir(parents=True, exist_ok=True)
    model_file = write_yaml(case_tree(base, model, "nothing", None), out / "model.yaml")
    seconds = POOR
    if motion == "excite":
        csv = out / "excitation.csv"
        limits = ("--stroke", "0.04", "--speed", "0.05", "--acceleration", "1")
        command("excite", "--config", model_file, "--out", str(csv), *limits)
        seconds = float(csv.read_text(encoding="utf-8").rstrip().rsplit("\n", 1)[1].split(",")[0])
        reference: dict[str, Any] = {"kind": "file", "file": str(csv)}
    else:
        reference = {"kind": motion}
        if motion == "multi_sine":
            reference |= {"amplitudes": [3.0e-3, 2.0e-4], "frequencies": [0.7, 5.3]}
    held = {"kind": "point_to_point", "amplitude": 0.03, "velocity": 0.03, "dwell": 0.3}
    for bag, settings, length, number in (("bag", reference, seconds, seed), ("held_out", held, HELD_OUT, seed + 1)):
        stage_file = write_yaml(case_tree(base, model, name, settings), out / f"{bag}.yaml")
        with contextlib.suppress(FileNotFoundError):
            for old in (out / bag).iterdir():
                old.unlink()
            (out / bag).rmdir()
        command("simulate", "--config", stage_file, "--out", str(out / bag), "--duration", f"{length:.3f}",
                "--seed", str(number))  # fmt: skip
    started = time.process_time()
    command("diagnose", str(out / "bag"), "--config", model_file, "--holdout", str(out / "held_out"), "--out",
            str(out / "diagnosis"), "--workers", "1")  # fmt: skip
    used = time.process_time() - started
    return judge(name, motion, json.loads((out / "diagnosis" / "result.json").read_text(encoding="utf-8")), used)


def judge(name: str, motion: str, result: dict[str, Any], used: float) -> Outcome:
    """Compare a result with the truth.

    Args:
        name: what was hidden.
        motion: as in ``run_case``.
        result: result.json.
        used: computing time of the diagnosis [s].
    """
    verdict, entries, gap = result["verdict"], result["effects"], result["gap"]
    is_naming = verdict in ("effect_found", "ambiguous") and bool(entries)
    first = entries[0]["name"] if is_naming else verdict
    is_right = first == ("no_effect" if name == "nothing" else name) and (not is_naming or len(entries) == 1)
    if motion != "excite":
        is_right = verdict != "effect_found" or all(item["name"] == name for item in entries)
    names = " + ".join("/".join([item["name"], *item["alternatives"]]) for item in entries)
    closure = "-" if gap["closure"] is None else f"{gap['closure']:.2f}"
    values = []
    for item in entries:
        for key, truth in HIDDEN[name].items() if item["name"] == name else ():
            values.append(f"{key} {item['parameters'][key]:.4g} ({truth:g})")
    line = (
        f"{name:28s} {'ok ' if is_right else 'BAD'} {first:28s} [{verdict}; {names}]"
        f" gap {gap['before']:.3g} -> {gap['after']:.3g} floor {gap['floor']:.3g} closure {closure}"
        f" {', '.join(values)} {used:.0f} s"
    )
    return Outcome(name, first, line, is_right)


def main() -> int:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--base", choices=("table", "default"), default="table")
    parser.add_argument("--model", choices=("sgms", "gms"), default="sgms")
    parser.add_argument("--motion", choices=("excite", "sine", "multi_sine", "point_to_point"), default="excite")
    parser.add_argument("--only", default="", help="these effects only (comma-separated)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("out/diagnosis"))
    args = parser.parse_args()
    names = args.only.split(",") if args.only else list(HIDDEN)
    if args.base == "default":
        names = [name for name in names if name != "cross_axis_coupling"]
    folder = args.out / f"{args.base}_{args.model}_{args.motion}"
    outcomes = []
    for name in names:
        outcomes.append(run_case(args.base, args.model, args.motion, name, folder / name, args.seed))
        print(outcomes[-1].line, flush=True)
    right = sum(item.is_right for item in outcomes)
    print(f"{right} of {len(outcomes)} right ({args.base}, {args.model}, {args.motion}, seed {args.seed})")
    return 0 if right == len(outcomes) else 1


if __name__ == "__main__":
    sys.exit(main())
