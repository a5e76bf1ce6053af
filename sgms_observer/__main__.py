"""The command ``sgms``, also as ``python -m sgms_observer``."""

import gc
import sys

from sgms_observer.interrupts import silent_interrupts


def main() -> int:
    """Run the command line.

    Returns:
        The exit code: 0 only on success.
    """
    with silent_interrupts():
        from sgms_observer.cli.main import main as run
    code = run()
    gc.freeze()  # what is left ends with the process; to look through it once more would take 0.2 s
    return code


if __name__ == "__main__":
    sys.exit(main())
