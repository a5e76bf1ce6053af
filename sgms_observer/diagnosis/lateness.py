"""A last look at time: once the forces are told apart, whether the effort also acts later than its stamp says.

A delay is a matter of the recording's timing as much as of the machine, and it hides behind every force that the model
misses. It is therefore read again after the last effect, and added without being one of the effects that are searched.
"""

from __future__ import annotations

from collections.abc import Sequence

from sgms_observer.diagnosis.decide import ALARM_GAIN, Round, alarm_threshold
from sgms_observer.diagnosis.fit import Refit, Refits
from sgms_observer.diagnosis.gate import SURE, Gate, sureness
from sgms_observer.diagnosis.name import fitted, polished
from sgms_observer.diagnosis.timing import NOBODYS
from sgms_observer.diagnosis.twins import Calibration

DELAY = "actuator_delay"
CLEAR = 2.0
"""Its standardised gain has to be this many times that of any force: what is unexplained looks a little late."""


def late_effort(
    refits: Refits, current: Refit, rounds: Sequence[Round], calibration: Calibration, gate: Gate
) -> Round | None:
    """Return a round that adds a delay to what was found, or None where there is none to be sure of.

    It has to be what stands out in the last look by far, to be longer than stamps are uncertain, and to lower the
    residual of the recordings to judge on for sure.

    Args:
        refits: to the recordings to learn from.
        current: fit with the effects so far.
        rounds: passes so far; the last one is the look at the residual of ``current``.
        calibration: twins of the nominal model.
        gate: recordings to judge on.
    """
    last = rounds[-1]
    if last.accepted or not any(item.accepted for item in rounds) or DELAY not in last.scores:
        return None
    others = max((score for name, score in last.scores.items() if name != DELAY), default=0.0)
    if last.scores[DELAY] < max(CLEAR * others, alarm_threshold(DELAY, calibration)):
        return None
    screen = last.screen
    column = screen.gains()[DELAY][1]
    if column is None:
        return None
    found = fitted(refits, current, column.start(screen.left_over()), screen.nominal_columns)
    found = polished(refits, current, found)
    sample = max(motion.period / motion.step for motion in refits.judged.motions)
    is_long = found.refit.effects[-1].values[0] > NOBODYS * sample
    is_sure = sureness(current.model, found.refit.model, gate.motions) > SURE
    if found.taken <= ALARM_GAIN or found.at_bound or not is_long or not is_sure:
        return None
    closure = gate.closure(current.model, found.refit.model)
    return Round(screen, last.scores, (found,), last.excess_before, last.excess_after, True, (), closure)
