"""Diagnoses the same recordings from ten start files, and counts how many give the same verdict and names.

    python benchmarks/plants/start_files.py --plant second --shared ../shared --only cogging,tight_spot --seeds 100

The files differ in what an owner may well have otherwise: 1 to 8 elements, S-GMS or GMS, stiffness off by a factor of
three, an offset listed or not.
"""

from __future__ import annotations

import argparse
import shutil
import sys
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(Path(__file__).resolve().parent))
sys.path.insert(0, str(ROOT))

import numpy as np  # noqa: E402
import yaml  # noqa: E402
from plant_cases import SECOND, cases  # noqa: E402
from plant_files import files_of, make_case  # noqa: E402
from run import diagnose_in_process, read_json  # noqa: E402

from sim_plant.plants.machine import PLANTS  # noqa: E402

CHANGED_BY_FACTOR = 3.0


@dataclass(frozen=True)
class Start:
    """What one start file has otherwise: number of elements (0 for the owner's), model, stiffness, offset."""

    elements: int = 0
    model: str = "sgms"
    stiffness: float = 1.0
    has_offset: bool = False

    @property
    def name(self) -> str:
        """Return a few words."""
        count = f"{self.elements} elements" if self.elements else "owner's elements"
        offset = ", offset listed" if self.has_offset else ""
        return f"{count}, {self.model}, stiffness x {self.stiffness:.3g}{offset}"


STARTS = (
    Start(), Start(1), Start(2), Start(8), Start(model="gms"), Start(stiffness=CHANGED_BY_FACTOR),
    Start(stiffness=1.0 / CHANGED_BY_FACTOR), Start(has_offset=True), Start(8, "gms", CHANGED_BY_FACTOR, True),
    Start(1, "gms", 1.0 / CHANGED_BY_FACTOR),
)  # fmt: skip


def start_file(owner: dict[str, Any], start: Start) -> dict[str, Any]:
    """Return the owner's file as a start file has it.

    Args:
        owner: parsed parameter file with one axis ``x``.
        start: what differs.
    """
    file = yaml.safe_load(yaml.safe_dump(owner))
    axis = file["/**"]["ros__parameters"]["x"]
    friction = axis["friction"]
    stiffness, fraction = (np.array(friction[key]) for key in ("element_stiffness", "element_fraction"))
    if start.elements:
        deflection = np.sort(fraction * friction["coulomb_force"] / stiffness)
        middle = float(np.exp(np.mean(np.log(deflection))))
        spread = np.geomspace(deflection[0], deflection[-1], start.elements) if start.elements > 1 else [middle]
        fraction = np.full(start.elements, 1.0 / start.elements)
        stiffness = fraction * friction["coulomb_force"] / np.array(spread)
    friction["element_stiffness"] = (start.stiffness * stiffness).tolist()
    friction["element_fraction"] = fraction.tolist()
    friction["element_damping"] = [0.0] * len(fraction)
    friction["model"] = start.model
    if start.has_offset:
        listed = axis.setdefault("effects", {})
        listed["names"] = [*listed.get("names", []), "offset"]
        listed["offset"] = {"force": 0.0}
    return file


def main() -> int:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--plant", choices=[*PLANTS, SECOND], default=SECOND)
    parser.add_argument("--only", default="nothing", help="hidden effects (comma-separated; nothing for none)")
    parser.add_argument("--seeds", type=int, default=0, metavar="FIRST", help="first seed")
    parser.add_argument("--duration", type=float, default=30.0, help="of each recording [s]")
    parser.add_argument("--shared", type=Path, help="folder that holds plants/second_plant.py (default: ../shared)")
    parser.add_argument("--out", type=Path, default=Path("out/start_files"))
    args = parser.parse_args()
    wanted = args.only.split(",")
    listed = {case.effect: case for case in cases(args.plant, "quick", args.seeds) if case.effect in wanted}
    print("| hidden | start file | verdict | names |\n|---|---|---|---|")
    for effect, case in listed.items():
        shutil.rmtree(files_of(case, args.out).folder, ignore_errors=True)
        files = make_case(case, args.out, args.duration, args.shared)
        owner = yaml.safe_load(files.config.read_text(encoding="utf-8"))
        answers: Counter[tuple[str, ...]] = Counter()
        for number, start in enumerate(STARTS):
            config = files.folder / f"start_{number}.yaml"
            config.write_text(yaml.safe_dump(start_file(owner, start)), encoding="utf-8")
            one = replace(files, config=config, result=files.folder / f"result_{number}")
            message = diagnose_in_process(one)["message"]
            found = read_json(one.result / "result.json")
            verdict = found["verdict"] if found else f"failed: {message}"
            names = tuple(entry["name"] for entry in found["effects"]) if found else ()
            answers[(verdict, *names)] += 1
            print(f"| {effect} | {start.name} | {verdict} | {', '.join(names)} |", flush=True)
        (same, count), *_others = answers.most_common()
        print(f"| {effect} | **{count} of {len(STARTS)} agree** | {same[0]} | {', '.join(same[1:])} |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
