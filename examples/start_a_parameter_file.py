"""Write a first parameter file from a bag, and check that file and bag fit together.

python examples/start_a_parameter_file.py
"""

from __future__ import annotations

import sys

import recordings

from sgms_observer.cli.main import main as sgms


def main() -> None:
    """Do the job of the example."""
    args = recordings.options(__doc__, "out/start", 8.0)
    data = recordings.make(args.out, args.seconds)
    bag, yaml = str(data.learn), str(args.out / "first.yaml")
    for words in (["info", bag, "--joint-type", "prismatic"], ["init", bag, "--out", yaml, "--overwrite"]):
        if code := sgms(words):
            sys.exit(code)
    sys.exit(sgms(["check", yaml, bag]))


if __name__ == "__main__":
    main()
