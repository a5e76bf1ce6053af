"""Find what the model lacks, from a fitted recording and a held-out one.

python examples/diagnose_a_bag.py
"""

from __future__ import annotations

import json
import sys

import recordings

from sgms_observer.cli.main import main as sgms


def main() -> None:
    """Do the job of the example."""
    args = recordings.options(__doc__, "out/diagnose", 30.0)
    data = recordings.make(args.out, args.seconds)
    words = ["diagnose", data.learn, "--config", data.config, "--holdout", data.judge, "--out", args.out / "diagnosis"]
    code = sgms([*(str(word) for word in words), "--overwrite"])
    if code not in (0, 3):
        sys.exit(code)
    result = json.loads((args.out / "diagnosis" / "result.json").read_text(encoding="utf-8"))
    print(f"found: {', '.join(effect['name'] for effect in result['effects']) or 'nothing'} (truth: cogging)")
    print(f"open {args.out / 'diagnosis' / 'report.html'}")


if __name__ == "__main__":
    main()
