"""Export the observer and its compensation as C, and compile it.

python examples/export_c.py
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

import recordings

from sgms_observer.cli.main import main as sgms


def main() -> None:
    """Do the job of the example."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out/export"), help="folder of all files")
    args = parser.parse_args()
    config = recordings.make(args.out, 1.0).config
    code = sgms(["export", str(config), "--target", "c", "--out", str(args.out / "c"), "--overwrite"])
    if code != 0:
        sys.exit(code)
    subprocess.run(["make", "test"], cwd=args.out / "c", check=True)  # compiles, and compares with Python's numbers


if __name__ == "__main__":
    main()
