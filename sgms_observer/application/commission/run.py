"""A commissioning from the first step to the last; a rerun goes on behind the last step that is finished."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from sgms_observer.application.commission import check, compensate, learn, page
from sgms_observer.application.commission.next_experiment import next_experiment
from sgms_observer.application.commission.session import DONE, FAILED, SKIPPED, Ledger, Session
from sgms_observer.errors import SgmsError

TIME_IS_OVER = "not begun, because the time of --time is over; start again to go on from here"


@dataclass(frozen=True)
class StepWork:
    """One step.

    Attributes:
        name: as in commission.json.
        work: does it; returns what it found and the files it wrote.
        moves: whether it needs the table.
    """

    name: str
    work: Callable[[Session], tuple[str, Sequence[str]]]
    moves: bool


STEPS = (
    StepWork("check", check.check, True),
    StepWork("excite", learn.excite, False),
    StepWork("record", learn.record, True),
    StepWork("identify", learn.identify, False),
    StepWork("diagnose", learn.diagnose, False),
    StepWork("next_experiment", next_experiment, True),
    StepWork("observe", compensate.observe, True),
    StepWork("compensate", compensate.compensate, True),
    StepWork("before_and_after", compensate.before_and_after, True),
    StepWork("report", page.write_report, False),
)


def commission(session: Session) -> Ledger:
    """Do the steps that are not done yet.

    Args:
        session: the session; its ledger says what is done.

    Returns:
        The ledger.

    Raises:
        SgmsError: a step failed; the ledger says which, and a rerun goes on with it.
        KeyboardInterrupt: the user stopped it; as before.
    """
    ledger = session.ledger
    is_connected = False
    for step in STEPS:
        if ledger.is_finished(step.name):
            ledger.repeat(step.name)
            session.say(f"{step.name}: done before; {ledger.steps[step.name].sentence}")
            continue
        if session.seconds_left <= 0.0:
            ledger.note(step.name, SKIPPED, 0.0, TIME_IS_OVER)
            session.say(f"{step.name}: {TIME_IS_OVER}")
            break
        begun = time.monotonic()
        with _noting(session, step.name):
            if step.moves and not is_connected:
                session.say(f"table: {check.connect(session)}")
                is_connected = True
            sentence, files = step.work(session)
        ledger.note(step.name, DONE, time.monotonic() - begun, sentence, files)
        session.say(f"{step.name}: {sentence}")
    ledger.write()
    return ledger


@contextmanager
def _noting(session: Session, name: str) -> Iterator[None]:
    """Note in the ledger what stops a step."""
    begun = time.monotonic()

    def note(sentence: str) -> None:
        session.ledger.note(name, FAILED, time.monotonic() - begun, sentence)

    try:
        yield
    except KeyboardInterrupt:
        note("interrupted by the user; start again to go on from here")
        raise
    except SgmsError as error:
        note(str(error))
        raise
    except Exception as error:
        note(f"Internal error, {type(error).__name__}: {error}")
        raise
