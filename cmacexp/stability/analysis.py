"""The stability analysis of a run: the verdict with other leads, the growth that is predicted, and the reasons."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cmacexp.config import Config
from cmacexp.data.run import Run, read_config
from cmacexp.loop.scenario import make_scenario
from cmacexp.plants import AnalyticPlant
from cmacexp.stability.growth import GROWTH_CYCLES, Growth, change_sizes, predicted_growth, with_lead
from cmacexp.stability.transfer import Spectrum, spectra_along
from cmacexp.stability.verdict import FREQUENCIES, PLACES, Verdict, assess
from cmacexp.typing import Array

LEADS = (-2, -1, 0, 1, 2, 3)


@dataclass(frozen=True)
class Analysis:
    """The stability of one run, without the guard of learning."""

    lead: int
    """Of the run, samples."""
    verdicts: Mapping[int, Verdict]
    """By lead, that of the run among them."""
    growth: Growth
    """Predicted from an early cycle of the run."""
    sizes: Sequence[float]
    """(n,): changes of the feedback from cycle to cycle in memory, up to the end of the prediction, N m."""
    spectra: Sequence[Spectrum]
    """T at places of the cycle, at the same frequencies."""

    def least_real(self, lead: int) -> Array:
        """Least Re T over the places, at each frequency."""
        return np.min([spectrum.least_real(lead) for spectrum in self.spectra], axis=0)


def read_learning(run: Run) -> Config:
    """The config of a run; of a lead that it estimated, with the last estimate."""
    config = read_config(run)
    return with_lead(config, int(run.manifest["learning_lead"])) if config.learning.lead == "estimate" else config


def analyse(config: Config, verdict: Verdict) -> Analysis:
    """Judge other leads of a run, of whose config :func:`read_learning` there is a verdict, and linearise its loop.

    Raises NotPredictable if it does not learn, ends before that shows, or its loop cannot be linearised.
    """
    scenario = make_scenario(config)
    growth = predicted_growth(config, prepared=scenario)
    is_quick = isinstance(scenario.plant, AnalyticPlant)  # on others each lead takes minutes
    leads = sorted({*LEADS, verdict.lead}) if is_quick else [verdict.lead]
    return Analysis(
        verdict.lead,
        {lead: verdict if lead == verdict.lead else assess(with_lead(config, lead)) for lead in leads},
        growth,
        change_sizes(config, growth.cycle + GROWTH_CYCLES),
        spectra_along(config, growth.cycle, PLACES, FREQUENCIES),
    )
