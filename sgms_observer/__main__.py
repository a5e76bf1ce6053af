"""The command ``sgms``, also as ``python -m sgms_observer``."""

import sys

from sgms_observer.interrupts import silent_interrupts


def main() -> int:
    """Run the command line.

    Returns:
        The exit code: 0 only on success.
    """
    with silent_interrupts():
        from sgms_observer.cli.main import main as run
    return run()


if __name__ == "__main__":
    sys.exit(main())
