"""A commissioning from the first step to the last; a rerun continues after the last finished step."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass

from sgms_observer.application.commission import check, compensate, learn, page
from sgms_observer.application.commission.ledger import DONE, FAILED, SKIPPED, Ledger
from sgms_observer.application.commission.next_experiment import next_experiment
from sgms_observer.application.commission.session import OutOfTime, Session
from sgms_observer.errors import SgmsError
from sgms_observer.interrupts import obey_interrupt

STOPPED_AFTER = "stopped_after"
"""Fact: run time of each step that --time stopped [s]; it is not started again with less time."""


@dataclass(frozen=True)
class StepWork:
    """One step.

    Attributes:
        name: as in commission.json.
        work: does the step; returns its result and its files.
        moves: whether it needs the axis on the graph.
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


def commission(session: Session, graph: AbstractContextManager[object]) -> Ledger:
    """Do the unfinished steps; write the page in any case, after the last motion.

    Args:
        session: the session; its ledger holds the finished steps.
        graph: context manager that connects the axis of the session to the graph.

    Returns:
        The ledger.

    Raises:
        SgmsError: a step failed; ledger and page name it, and a rerun continues with it.
        KeyboardInterrupt: the user stopped it; a rerun continues.
    """
    *steps, report = STEPS
    try:
        with graph:
            _do(session, steps)
    except BaseException as error:
        with suppress(Exception):  # the first error is the one to report
            if isinstance(error, KeyboardInterrupt):
                _note_interrupt(session.ledger, steps, error)
            _do(session, [report])
        raise
    _do(session, [report])
    return session.ledger


def _do(session: Session, steps: Sequence[StepWork]) -> None:
    """Do the unfinished steps in their order; after a stopped step the later ones are skipped."""
    ledger = session.ledger
    is_connected = False
    for number, step in enumerate(steps):
        if ledger.is_finished(step.name):
            ledger.repeat(step.name)
            session.say(f"{step.name}: done before; {ledger.steps[step.name].sentence}")
            continue
        ledger.begin(step.name)
        begun, stopped_by = time.monotonic(), None
        stopped_after = ledger.facts.setdefault(STOPPED_AFTER, {})
        try:
            if step.name != "report":
                session.need(stopped_after.get(step.name, 0.0), step.name)
            if step.moves and not is_connected:
                session.say(f"axis: {check.connect(session)}")
                is_connected = True
            state, (sentence, files) = DONE, step.work(session)
        except (Exception, KeyboardInterrupt) as error:
            stopped_by = error
            (state, sentence), files = _state_and_sentence(error), ()
        seconds = time.monotonic() - begun
        if state == DONE:
            stopped_after.pop(step.name, None)
        elif state == SKIPPED and not step.moves:
            stopped_after[step.name] = max(seconds, stopped_after.get(step.name, 0.0))
        ledger.note(step.name, state, seconds, sentence, files, session.take_warnings())
        if state != FAILED:
            session.say(f"{step.name}: {sentence}")
        if stopped_by is not None:
            what = "failed" if state == FAILED else "was left out"
            for later in steps[number + 1 :]:
                ledger.note(later.name, SKIPPED, 0.0, f"not begun, because step {step.name} {what}")
            if state == FAILED:
                raise stopped_by
            return
    ledger.write()


def _note_interrupt(ledger: Ledger, steps: Sequence[StepWork], error: KeyboardInterrupt) -> None:
    """Note an interrupt between two steps at the next one, where a rerun begins."""
    state, sentence = _state_and_sentence(error)
    unfinished = [step.name for step in steps if not ledger.is_finished(step.name)]
    if unfinished and unfinished[0] not in ledger.steps:
        ledger.note(unfinished[0], state, 0.0, sentence)


def _state_and_sentence(error: BaseException) -> tuple[str, str]:
    """Return state and sentence of a stopped step."""
    if isinstance(error, OutOfTime):
        return SKIPPED, str(error)
    if isinstance(error, KeyboardInterrupt):
        obey_interrupt()
        return FAILED, "interrupted by the user; start again to go on from here"
    if isinstance(error, SgmsError):
        return FAILED, str(error)
    return FAILED, f"Internal error, {type(error).__name__}: {error}"
