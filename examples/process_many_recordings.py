"""Diagnose several recordings, each by itself, and read the summary.

python examples/process_many_recordings.py
"""

from __future__ import annotations

import json
import sys

import recordings

from sgms_observer.cli.main import main as sgms


def main() -> None:
    """Do the job of the example."""
    args = recordings.options(__doc__, "out/many", 20.0)
    data = recordings.make(args.out, args.seconds)
    bags = [str(data.learn), str(data.judge)]
    out = args.out / "diagnosed"
    code = sgms(["diagnose", "--each", *bags, "--config", str(data.config), "--out", str(out), "--overwrite"])
    if code != 0:
        sys.exit(code)
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    for entry in summary["recordings"]:
        names = ", ".join(effect["name"] for effect in entry["effects"]) or "nothing"
        print(f"{entry['name']}: {entry['verdict']}, found {names} (truth: cogging)")
    print(f"open {out / 'report.html'}")


if __name__ == "__main__":
    main()
