"""The stability analysis of a run: the verdict with other leads, the growth that is predicted, and the reasons."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cmacexp.config import Config
from cmacexp.data.stored_run import StoredRun, read_config
from cmacexp.loop.scenario import make_scenario
from cmacexp.plants import AnalyticPlant
from cmacexp.stability.growth import GROWTH_CYCLES, Growth, change_sizes, predicted_growth, with_lead
from cmacexp.stability.transfer import Spectrum, compute_spectrum, locals_along
from cmacexp.stability.verdict import Verdict, assess

LEADS = (-2, -1, 0, 1, 2, 3)
LOWEST_FREQUENCY = 1.0
"""Lowest frequency of T, Hz; the highest is half the sampling rate."""
FREQUENCIES = 200
"""Number of frequencies at which T is computed."""
STEPS_AFTER_LIFT_OFF = 5
"""Samples after lift-off where T is computed: the foot has left the ground."""


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
    places: dict[str, Spectrum]
    """T at a few places of the first leg's cycle."""

    def least_real(self, lead: int) -> float:
        """Least Re T over all frequencies and those places."""
        return min(spectrum.least(lead) for spectrum in self.places.values())


def choose_samples(support: Any) -> dict[str, int]:
    """Samples by the name of their place: after the first leg's lift-off, in mid transfer and in mid support."""
    first_leg, n = support[:, 0], len(support)
    if first_leg.all():
        return {"standing": n // 2}
    lift = int(np.flatnonzero(~first_leg & np.roll(first_leg, 1))[0])
    transfer = int((~first_leg).sum())
    middle = lift + transfer + (n - transfer) // 2
    return {
        f"{STEPS_AFTER_LIFT_OFF} samples after lift-off": (lift + STEPS_AFTER_LIFT_OFF) % n,
        "mid transfer": (lift + transfer // 2) % n,
        "mid support": middle % n,
    }


def read_learning(run: StoredRun) -> Config:
    """The config of a run; of a lead that it estimated, with the last estimate.

    Raises:
        BadRun: it cannot be read.
    """
    config = read_config(run)
    return with_lead(config, int(run.manifest["learning_lead"])) if config.learning.lead == "estimate" else config


def analyse(config: Config, verdict: Verdict) -> Analysis:
    """Judge other leads of a run, and linearise its loop.

    Args:
        config: of the run, see :func:`read_learning`.
        verdict: on it.

    Raises:
        NotPredictable: it does not learn, ends before that shows, or its loop cannot be linearised.
    """
    scenario = make_scenario(config)
    growth = predicted_growth(config, prepared=scenario)
    is_quick = isinstance(scenario.plant, AnalyticPlant)  # on others each lead takes minutes
    leads = sorted({*LEADS, verdict.lead}) if is_quick else [verdict.lead]
    period, places = config.sampling_period, choose_samples(scenario.setup.plan.support)
    by_sample = {local.sample: local for local in locals_along(config, growth.cycle, list(places.values()))}
    frequencies = np.linspace(min(LOWEST_FREQUENCY, 0.05 / period), 0.5 / period, FREQUENCIES)
    return Analysis(
        verdict.lead,
        {lead: verdict if lead == verdict.lead else assess(with_lead(config, lead)) for lead in leads},
        growth,
        change_sizes(config, growth.cycle + GROWTH_CYCLES),
        {name: compute_spectrum(by_sample[sample], frequencies, period) for name, sample in places.items()},
    )
