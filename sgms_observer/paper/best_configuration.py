"""Beyond Table II: the package's own best configuration on the same signals, what each lever gave, and consistency."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.filters.differentiator import effort_noise_gain
from sgms_observer.paper.conditions import (
    CHOSEN,
    LOWPASS,
    LOWPASS_RAW_EFFORT,
    PROCESS_STD,
    ROWS,
    SAMPLE_PERIOD,
    SINE_PERIOD,
    Estimate,
    Step,
    estimate,
    estimator_friction,
    fewer,
    nrmse,
    simulate,
)
from sgms_observer.settings.axis import EstimatorSettings, FilterSettings
from sim_plant.record import StageRecord

PERIODS = 11  # the last one follows ten periods of learning
_SECONDS_TO_SETTLE = 0.05  # s at the start that the whole-run figures leave out
_BAND = 1.959964  # standard deviations on either side of a 95 % band


@dataclass(frozen=True)
class Configuration:
    """A filter, a model and an estimator; every estimate is live, at its own instant.

    Args:
        filter: block V.
        model: ``gms`` or ``sgms``.
        estimator: block Z; its ``measurement_std`` is set by ``is_matched``.
        is_matched: R is the noise that the filter leaves; else the paper's (0.1 N)^2.
    """

    filter: FilterSettings
    model: str
    estimator: EstimatorSettings
    is_matched: bool = True

    @property
    def settings(self) -> EstimatorSettings:
        """Return the estimator's settings with R in place."""
        gain = effort_noise_gain(self.filter, SAMPLE_PERIOD) if self.is_matched else 1.0
        return replace(self.estimator, measurement_std=0.1 * gain)


BEST = Configuration(
    filter=FilterSettings(kind="savgol", window=4.0e-4, degree=3),
    model="gms",
    estimator=EstimatorSettings(
        kind="mhe",
        parameters=("kappa",),
        correction_every=20,
        horizon=4,
        iterations=2,
        process_std=2.0e-4,
        parameter_walk=1.0e-4,
    ),
)
_PAPERS = EstimatorSettings(
    kind="mhe", parameters=("kappa",), correction_every=20, horizon=4, iterations=2, process_std=PROCESS_STD
)

LADDER: dict[str, Configuration] = {
    "the paper's MHE(z,p), S-GMS, effort ahead of the acceleration": Configuration(
        LOWPASS_RAW_EFFORT, "sgms", _PAPERS, is_matched=False
    ),
    "+ effort through the same low-pass, delay bridged": Configuration(LOWPASS, "sgms", _PAPERS, is_matched=False),
    "+ polynomial filter": Configuration(BEST.filter, "sgms", _PAPERS, is_matched=False),
    "+ slip memory and attraction (GMS)": Configuration(BEST.filter, "gms", _PAPERS, is_matched=False),
    "+ R as the filter leaves it": Configuration(BEST.filter, "gms", _PAPERS),
    "+ Q as small as the model is right: the best": BEST,
}

WITHOUT: dict[str, Configuration] = {
    "the effort's alignment": replace(BEST, filter=replace(BEST.filter, align_effort=False)),
    "the polynomial filter (the paper's low-pass, aligned)": replace(BEST, filter=LOWPASS),
    "slip memory and attraction (S-GMS)": replace(BEST, model="sgms"),
    "estimating kappa": replace(BEST, estimator=replace(BEST.estimator, parameters=())),
    "a window: EKF(z,p)": replace(BEST, estimator=replace(BEST.estimator, kind="ekf")),
    "a second iteration": replace(BEST, estimator=replace(BEST.estimator, iterations=1)),
    "a short window: N = 16": replace(BEST, estimator=replace(BEST.estimator, horizon=16)),
    "kappa's small walk in the arrival cost": replace(BEST, estimator=replace(BEST.estimator, parameter_walk=0.0)),
    "matched R": replace(BEST, is_matched=False),
    "small Q": replace(BEST, estimator=replace(BEST.estimator, process_std=PROCESS_STD)),
}


def run(configuration: Configuration, record: StageRecord, factor: float) -> Estimate:
    """Run one configuration over one record."""
    friction = replace(estimator_friction(configuration.model, factor), reset="rate_independent")
    return estimate(
        record, configuration.filter, configuration.settings, friction, CHOSEN.mass, factor, with_trajectory=False
    )


def score(configuration: Configuration, records: list[StageRecord], step: Step = lambda: None) -> dict[str, Any]:
    """Return error and kappa of both rows, each a mean over the records, and the worst kappa.

    Args:
        configuration: what to run.
        records: one per noise seed.
        step: called after every run of the estimator.
    """
    result: dict[str, Any] = {}
    after_ten = round(10 * SINE_PERIOD / SAMPLE_PERIOD)
    for row, factor in ROWS.items():
        errors, ratios = [], []
        for record in records:
            outcome = run(configuration, record, factor)
            errors.append(nrmse(record, outcome.live, PERIODS))
            ratios.append(float(outcome.stiffness[after_ten]))
            step()
        result[row] = {
            "nrmse": float(np.mean(errors)),
            "standard_deviation": float(np.std(errors)),
            "kappa_over_truth_after_ten_periods": float(np.mean(ratios)),
            "worst_kappa_error": float(np.max(np.abs(np.array(ratios) - 1.0))),
        }
    return result


def consistency(seeds: int, step: Step = lambda: None) -> dict[str, Any]:
    """Return NIS and band coverage of the best configuration over many noise seeds; the model is right, kappa is not.

    At every correction of the last period the NIS is averaged over the seeds; its 95 % bounds are those of a chi-square
    with one degree of freedom per seed. Coverage is the share of time the truth lies in the 95 % band, start left out.
    """
    from scipy.stats import chi2

    lower, upper = (float(x) for x in chi2.ppf([0.025, 0.975], seeds) / seeds)
    last = slice(round((PERIODS - 1) * SINE_PERIOD / SAMPLE_PERIOD), None)
    settled = slice(round(_SECONDS_TO_SETTLE / SAMPLE_PERIOD), None)
    result: dict[str, Any] = {"seeds": seeds, "bounds": [lower, upper]}
    for row, factor in ROWS.items():
        by_seed, covered = [], []
        for seed in range(1, seeds + 1):
            record = simulate(CHOSEN, PERIODS, seed)
            outcome = run(BEST, record, factor)
            by_seed.append(_nis(outcome, last))
            deviation = outcome.results.friction_std[settled]
            covered.append(np.mean(np.abs(outcome.live - record.friction)[settled] <= _BAND * deviation))
            step()
        means = np.mean(by_seed, axis=0)
        result[row] = {
            "nis_mean": float(np.mean(means)),
            "share_of_corrections_within_bounds": float(np.mean((means >= lower) & (means <= upper))),
            "band_coverage": float(np.mean(covered)),
        }
    return result


def _nis(outcome: Estimate, span: slice) -> Floats:
    """Return the normalised innovation squared at every correction in ``span``."""
    nis = (outcome.results.innovation[span] / outcome.results.innovation_std[span]) ** 2
    corrections: Floats = nis[np.isfinite(nis)]
    return corrections


def runs_beyond(seeds: int, consistency_seeds: int) -> int:
    """Return how many runs of an estimator ``beyond`` makes."""
    return len(ROWS) * (seeds + (len(LADDER) + len(WITHOUT)) * fewer(seeds) + consistency_seeds)


def beyond(seeds: int, consistency_seeds: int, step: Step = lambda: None) -> dict[str, Any]:
    """Compute everything that ``beyond.json`` holds.

    Args:
        seeds: noise seeds for errors; a quarter of them for the ablation.
        consistency_seeds: noise seeds for NIS and coverage.
        step: called after every run of an estimator.
    """
    records = [simulate(CHOSEN, PERIODS, seed) for seed in range(1, seeds + 1)]
    few = records[: fewer(seeds)]
    best = score(BEST, records, step)
    ladder = {name: score(configuration, few, step) for name, configuration in LADDER.items()}
    without = {name: score(configuration, few, step) for name, configuration in WITHOUT.items()}
    return {
        "minus20": best["minus20"],
        "plus20": best["plus20"],
        "configuration": {
            "filter": vars(BEST.filter),
            "model": BEST.model,
            "estimator": vars(BEST.settings),
            "stage": vars(CHOSEN),
        },
        "ladder": ladder,
        "best_without": without,
        "consistency": consistency(consistency_seeds, step),
        "conditions": {
            "seeds": list(range(1, seeds + 1)),
            "seeds_of_ablation": len(few),
            "period": PERIODS,
            "unit": "% of the range of the friction, live at each instant",
        },
    }


def beyond_markdown(result: dict[str, Any]) -> str:
    """Return ``beyond.md`` for the result of ``beyond``."""
    lines = [
        "# Beyond Table II",
        "",
        f"NRMSE [%] over period {PERIODS}, live at each instant, same stage and noise, position and effort only;"
        " in brackets kappa over the truth after ten periods.",
        "",
        "| configuration | kappa -20 % | kappa +20 % |",
        "|---|---|---|",
        _line(f"**best, {len(result['conditions']['seeds'])} seeds**", result),
    ]
    lines += [_line(name, scores) for name, scores in result["ladder"].items()]
    lines += [_line(f"best without: {name}", scores) for name, scores in result["best_without"].items()]
    found = result["consistency"]
    lower, upper = found["bounds"]
    lines += ["", f"Consistency over {found['seeds']} seeds (bounds of the mean NIS {lower:.2f} to {upper:.2f}):", ""]
    for row in ROWS:
        share, covered = found[row]["share_of_corrections_within_bounds"], found[row]["band_coverage"]
        lines.append(
            f"- {row}: mean NIS {found[row]['nis_mean']:.3f}; {100 * share:.0f} % of the corrections within the bounds;"
            f" the 95 % band covers the truth {100 * covered:.1f} % of the time."
        )
    return "\n".join(lines) + "\n"


def _line(name: str, scores: dict[str, Any]) -> str:
    entries = [f"{scores[row]['nrmse']:.3f} ({scores[row]['kappa_over_truth_after_ten_periods']:.3f})" for row in ROWS]
    return f"| {name} | " + " | ".join(entries) + " |"
