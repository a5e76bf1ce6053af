"""Read result.json of a diagnosis: verdict, gap, effects with their standard errors, warnings.

python examples/read_a_result.py out/diagnose/diagnosis/result.json
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path


def main() -> None:
    """Do the job of the example."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("result", type=Path, nargs="?", default=Path("out/diagnose/diagnosis/result.json"))
    args = parser.parse_args()
    result = json.loads(args.result.read_text(encoding="utf-8"))
    for warning in result["warnings"]:
        print(f"Warning: {warning}")
    gap = result["gap"]
    print(f"{result['verdict']}, usable: {result['usable']}")
    print(
        f"gap on {gap['on']} data: {gap['before']:.3g} -> {gap['after']:.3g} {gap['unit']} (floor {gap['floor']:.3g})"
    )
    for effect in result["effects"]:
        print(
            f"{effect['name']}, confidence {effect['confidence']:.2f}, alternatives: {effect['alternatives'] or 'none'}"
        )
        for name, value in effect["parameters"].items():
            print(f"  {name} = {value:.5g} +- {effect['std_error'][name]:.2g}")
    if result["next_experiment"]:
        print(f"record next: {result['next_experiment']}")


if __name__ == "__main__":
    main()
