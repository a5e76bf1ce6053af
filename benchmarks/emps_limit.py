"""Prints how well any model of the EMPS train record can predict the pulses record.

    python benchmarks/emps_limit.py --data FOLDER_WITH_MAT_FILES

Both records are fitted by least squares with one model that is linear in its parameters: mass, viscous friction by
direction, Coulomb friction with a Stribeck fall, offset, delay. Then some parameters of the train record are replaced
by those of the pulses record, and every quarter of each record is fitted alone: a parameter that is the same in all
quarters of a record and differs between the records has changed, and no recording of the one tells the other.

Data: A. Janot, M. Gautier, M. Brunot, "Data set and reference models of EMPS", 2019; see docs/emps.md.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))
sys.path.insert(0, str(ROOT / "examples"))

from emps import FILES, MAP, START  # noqa: E402

from sgms_observer.arrays import Floats  # noqa: E402
from sgms_observer.bags.conversion import parse_map, read_table, write_table  # noqa: E402
from sgms_observer.diagnosis.motion import Motion, motion_of  # noqa: E402
from sgms_observer.offline.recording import read_recordings  # noqa: E402
from sgms_observer.settings.load import load_settings  # noqa: E402

NAMES = (
    "mass [kg]", "viscous [N s/m]", "viscous, even part [N s/m]", "Coulomb [N]", "Stribeck 3 mm/s [N]",
    "Stribeck 10 mm/s [N]", "Stribeck 30 mm/s [N]", "offset [N]", "delay [ms]",
)  # fmt: skip
SLIDING = 1.0e-3
"""Velocity at which the sign of the friction has turned [m/s]."""
REPLACED = (("mass [kg]",), ("Coulomb [N]",), ("mass [kg]", "Coulomb [N]"), ("mass [kg]", "Coulomb [N]", "delay [ms]"))
"""Parameters that are taken from the pulses record."""
QUARTERS = 4


def columns(motion: Motion) -> Floats:
    """Return what a unit of each parameter adds to the effort below the band, shape (n, len(NAMES))."""
    v, sign = motion.velocity, np.tanh(motion.velocity / SLIDING)
    falls = [sign * np.exp(-np.abs(v) / knee) for knee in (3.0e-3, 1.0e-2, 3.0e-2)]
    late = -1.0e-3 * np.gradient(motion.effort, motion.period)
    listed = [motion.acceleration, v, np.abs(v), sign, *falls, np.ones(len(v)), -late]
    return np.column_stack([motion.low_pass(column) for column in listed])


def solved(matrix: Floats, effort: Floats) -> Floats:
    """Return the least-squares parameters."""
    return np.asarray(np.linalg.lstsq(matrix, effort, rcond=None)[0])


def main() -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    default = os.environ.get("SGMS_DATA", str(ROOT.parent / "shared" / "data"))
    parser.add_argument("--data", default=str(Path(default) / "emps"), help="folder with the two .mat files")
    data = Path(parser.parse_args().data)
    axis = load_settings(START).axes[0]
    matrices, efforts = {}, {}
    with tempfile.TemporaryDirectory() as folder:
        for name, file in FILES.items():
            write_table(read_table(data / file, parse_map(MAP)), Path(folder) / name, "x")
            motion = motion_of(read_recordings(Path(folder) / name, axis)[0])
            matrices[name], efforts[name] = columns(motion), motion.low_pass(motion.effort)

    def error(name: str, parameters: Floats) -> str:
        left = efforts[name] - matrices[name] @ parameters
        return f"{100.0 * float(np.linalg.norm(left) / np.linalg.norm(efforts[name])):.2f} %"

    found = {name: solved(matrices[name], efforts[name]) for name in FILES}
    print("relative force error on the pulses record")
    print(f"  all parameters from the pulses record: {error('pulses', found['pulses'])}")
    print(f"  all parameters from the train record: {error('pulses', found['train'])}")
    rest = efforts["pulses"] - matrices["pulses"] @ found["train"]
    for names in REPLACED:
        places = [NAMES.index(name) for name in names]
        moved = found["train"].copy()
        moved[places] += solved(matrices["pulses"][:, places], rest)
        which = ", ".join(name.split(" [")[0] for name in names)
        print(f"  from the train record, but {which}: {error('pulses', moved)}")
    print("parameters, and those of each quarter of the record alone")
    for k in (NAMES.index("mass [kg]"), NAMES.index("Coulomb [N]"), NAMES.index("delay [ms]")):
        for name in FILES:
            parts = zip(np.array_split(matrices[name], QUARTERS), np.array_split(efforts[name], QUARTERS), strict=True)
            quarters = "  ".join(f"{solved(*part)[k]:.3g}" for part in parts)
            print(f"  {NAMES[k]}, {name}: {found[name][k]:.4g}   {quarters}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
