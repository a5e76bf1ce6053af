"""``python -m sgms_observer`` is ``sgms``."""

import sys

from sgms_observer.cli.main import main

sys.exit(main())
