"""Status codes of an observer and their sentences for the user."""

from __future__ import annotations

from enum import IntEnum

MAX_NIS = 2.0
"""Largest mean NIS of a model that fits a recording [-]; then the standard deviations are 1.4 times too small."""
MAX_LIVE_NIS = 5.0
"""Mean NIS above which the live node warns [-]; larger than ``MAX_NIS``, because it is a mean of a short time."""


class Status(IntEnum):
    """State of one axis's estimate, worst last."""

    RUNNING = 0
    STARTING = 1
    PREDICTING = 2
    SAMPLE_REJECTED = 3
    FALLBACK_NOT_CONVERGED = 4
    FALLBACK_NOT_FINITE = 5
    FALLBACK_DEADLINE = 6
    RESTARTED_AFTER_GAP = 7
    RESTARTED_AFTER_JUMP = 8
    TOO_DENSE = 9

    @property
    def sentence(self) -> str:
        """Return the sentence for people."""
        return _SENTENCES[self]


_SENTENCES = {
    Status.RUNNING: "the estimator runs on good samples",
    Status.STARTING: "the filters are filling; estimates follow shortly",
    Status.PREDICTING: "no usable effort: the friction is predicted from the motion alone; check control_effort",
    Status.SAMPLE_REJECTED: "a sample was rejected: it was impossible or disagreed with the model beyond outlier_nis",
    Status.FALLBACK_NOT_CONVERGED: "the MHE step failed; the EKF estimate was used",
    Status.FALLBACK_NOT_FINITE: "a result was not finite; the EKF went on from the last good estimate",
    Status.FALLBACK_DEADLINE: "the last correction took longer than estimator.deadline; the EKF estimate was used",
    Status.RESTARTED_AFTER_GAP: (
        "samples paused for longer than filter.maximum_gap, or their clock was set back;"
        " filters and estimator restarted"
    ),
    Status.RESTARTED_AFTER_JUMP: (
        "the position jumped by more than filter.jump_speed allows; filters and estimator restarted, check the encoder"
    ),
    Status.TOO_DENSE: (
        "samples follow each other in less than half of sample_period; check for two publishers, or set sample_period"
    ),
}
