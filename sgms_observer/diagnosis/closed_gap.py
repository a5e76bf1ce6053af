"""What an effect closes of the gap: beside everything else, and in the place of another contact law."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from sgms_observer.diagnosis.diagnosis import WrittenFits
from sgms_observer.diagnosis.evaluation import EvaluationData
from sgms_observer.diagnosis.evidence import improvement
from sgms_observer.diagnosis.fit import WRITTEN_EVALUATIONS, RefitSetup
from sgms_observer.diagnosis.gap import WeightedResidual, residuals
from sgms_observer.diagnosis.model import Model
from sgms_observer.diagnosis.sliding import improvement_in_fast_sliding
from sgms_observer.effects.catalogue import is_contact_law
from sgms_observer.settings.axis import EffectSettings


@dataclass(frozen=True)
class Closed:
    """What an effect closes of the gap.

    Attributes:
        z_score: of the decrease of the squared gap.
        share: of the closable squared gap.
        share_above_floor: of the squared gap above the floor, also where that gap is hardly above it.
        share_in_fast_sliding: of the squared residual while the contact slides fast, beside a logarithmic friction.
    """

    z_score: float
    share: float
    share_above_floor: float
    share_in_fast_sliding: float


@dataclass(frozen=True)
class ClosedGap:
    """The final model, with and without single effects.

    Attributes:
        names: the effects that were accepted.
        written: fits without and with everything that was accepted.
        setup: setup of the final model with the contact of the file.
        evaluation: the recordings.
    """

    names: Sequence[str]
    written: WrittenFits
    setup: RefitSetup
    evaluation: EvaluationData

    def closed_by(self, name: str) -> Closed:
        """Return what an effect closes beside everything else.

        Without it everything else is fitted again, because the gaps of several effects are listed so.

        Args:
            name: the effect.
        """
        after = self.written.after
        setup, others = self.written.setup.without(name, after.effects)
        without = setup.fit(others, after.logs, evaluations=WRITTEN_EVALUATIONS)
        return self._closed(after.model, without.model)

    def closed_by_instead_of_contact_law(self, name: str) -> Closed:
        """Return what an effect closes where nothing else stands for another contact law.

        That is with the contact of the file, and without the effects that only describe another contact law.

        Args:
            name: the effect.
        """
        setup, others = self.setup.without(name, self._machine_effects)
        return self._closed(self._with_file_contact, self._fitted(setup, others))

    @property
    def has_other_contact_law(self) -> bool:
        """Return whether a change of the contact or another effect of the model stands for another contact law."""
        contacts = [(setup.nominal, setup.freedom) for setup in (self.written.setup, self.setup)]
        return contacts[0] != contacts[1] or len(self._machine_effects) < len(self.written.after.effects)

    @cached_property
    def _machine_effects(self) -> list[EffectSettings]:
        """The effects that do not only describe another contact law; effects of the file stay."""
        return [one for one in self.written.after.effects if one.name not in self.names or not is_contact_law(one.name)]

    @cached_property
    def _with_file_contact(self) -> Model:
        """The contact of the file with these effects."""
        return self._fitted(self.setup, self._machine_effects)

    def _fitted(self, setup: RefitSetup, effects: Sequence[EffectSettings]) -> Model:
        """Return the contact of the file, fitted with effects."""
        return setup.fit(effects, self.written.before.logs, evaluations=WRITTEN_EVALUATIONS).model

    def _closed(self, with_it: Model, others: Model) -> Closed:
        """Return what a model closes of the gap of another one."""
        evaluation = self.evaluation
        motions, block = evaluation.motions, evaluation.criteria.block
        before, after = (
            WeightedResidual(motions, residuals(one, motions), evaluation.weights) for one in (others, with_it)
        )
        gap = improvement(before.blocks(block), after.blocks(block))
        without = replace(evaluation, gap=evaluation.rms(others))
        return Closed(
            z_score=gap.z_score,
            share=without.closed_share(gap),
            share_above_floor=without.closed_share_above_floor(gap),
            share_in_fast_sliding=improvement_in_fast_sliding(with_it, before, after, evaluation.criteria).share,
        )
