"""Compiles one part of the kernels into the cache: ``python -m sgms_observer.application.kernel_part NAME``.

Prints a dot for each function that was compiled, so that whoever started it knows how far it is.
"""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable

import numpy as np

from sgms_observer import jit
from sgms_observer.settings.axis import Settings
from sgms_observer.settings.load import settings_from_tree

_SAMPLES = 200


def _settings() -> Settings:
    """Return one axis with an effect; kernels take sizes and choices as data, so these serve every configuration."""
    axis = {"mass": 10.0, "effects": {"names": ["offset"], "offset": {"force": 0.1}}}
    return settings_from_tree({"axes": ["x"], "x": axis})


def _estimator(settings: Settings) -> None:
    from sgms_observer.estimators.estimator import Estimator
    from sgms_observer.filters.motion import known_motion

    axis, zeros = settings.axes[0], np.zeros(_SAMPLES)
    motion = known_motion(np.full(_SAMPLES, settings.sample_period), zeros, zeros)
    Estimator(axis.estimator, axis.friction, axis.mass).step(motion, zeros, np.ones(_SAMPLES))


def _filter(settings: Settings) -> None:
    from sgms_observer.filters.differentiator import Differentiator

    stamps = np.arange(_SAMPLES, dtype=np.int64) * round(settings.sample_period * 1e9)
    differentiator = Differentiator(settings.axes[0].filter, settings.sample_period)
    differentiator.step(stamps, np.zeros(_SAMPLES), np.zeros(_SAMPLES))


def _stage(settings: Settings) -> None:
    from sim_plant.table import SimulatedTable

    SimulatedTable(settings).step(2)


def _observer(settings: Settings) -> None:
    from sgms_observer.bags.rows import warm_up_encoding
    from sgms_observer.observer.axis_observer import AxisObserver
    from sgms_observer.observer.trial import run_all_kernels

    warm_up_encoding()
    run_all_kernels(AxisObserver(settings.axes[0], settings.sample_period))


_WORK: dict[str, Callable[[Settings], None]] = {
    "estimator": _estimator,
    "filter": _filter,
    "stage": _stage,
    "observer": _observer,
}


def main() -> int:
    """Compile the part that is named on the command line."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # a compiler's callback may swallow an exception
    jit.tell_each_compilation(lambda: print(".", end="", flush=True))
    _WORK[sys.argv[1]](_settings())
    return 0


if __name__ == "__main__":
    sys.exit(main())
