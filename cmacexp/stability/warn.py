"""A warning before a long run whose learning will diverge."""

from dataclasses import replace

from cmacexp.config import Config
from cmacexp.loop.scenario import Scenario, resolve_lead
from cmacexp.report.terminal import activity

MIN_LEARNING_CYCLES = 100
"""Cycles of learning from which on a run is checked; the check takes the time of some 110."""
MAX_STEPS_PER_CYCLE = 10_000
"""Steps of all legs in a cycle above which the check is skipped: it would take a second or more."""
KRYLOV_DIMENSION = 40
"""Dimension of the Krylov space."""
BOUNDED_RULES = ("e_modification",)
"""Rules that hold the weights within a bound by themselves, which the linearised loop does not include."""
MIN_TOTAL_GROWTH = 10.0
"""A run whose feedback is predicted to grow by less over all its cycles is not warned of."""


def _is_checked(config: Config, scenario: Scenario) -> bool:
    steps = config.steps_per_cycle * len(scenario.setup.mechanism.legs) * getattr(config.plant, "substeps", 1)
    asked = config.warn and config.learning.rule not in BOUNDED_RULES
    return (
        asked and config.cycles - config.learning.start_cycle >= MIN_LEARNING_CYCLES and steps <= MAX_STEPS_PER_CYCLE
    )


def _growth(config: Config, scenario: Scenario | None = None) -> float:
    """Predicted growth per cycle; NaN where it cannot be predicted."""
    from cmacexp.stability.cycle_map import NotPredictable
    from cmacexp.stability.growth import predicted_growth

    try:
        return predicted_growth(config, dimension=KRYLOV_DIMENSION, prepared=scenario).per_cycle
    except NotPredictable:
        return float("nan")


def _cure(config: Config, scenario: Scenario) -> str:
    """A sentence that names a lead that is predicted to hold."""
    from cmacexp.stability.growth import with_lead

    own = scenario.setup.lead
    automatic = resolve_lead(replace(config, learning=replace(config.learning, lead="auto")), scenario.sensors)
    tried = [lead for lead in dict.fromkeys((automatic, own + 1, own - 1)) if lead != own]
    for lead in tried:
        growth = _growth(with_lead(config, lead))
        if growth < 1.0:
            return f"learning.lead={lead} is predicted to hold ({growth:.3f})"
    return f"learning.lead={' and '.join(map(str, tried))} would not hold either; try learning.rule=weight_smoothing"


def growth_warning(config: Config, scenario: Scenario) -> str | None:
    """The warning before a run; None if its learning holds, the run is short, or nothing can be predicted.

    Args:
        config: of the run.
        scenario: its components, which stay unchanged.
    """
    if not _is_checked(config, scenario):
        return None
    with activity("checking whether learning holds"):
        growth = _growth(config, scenario)
        if not growth > 1.0 or growth ** (config.cycles - config.learning.start_cycle) < MIN_TOTAL_GROWTH:
            return None
        return (
            f"warning: learning is predicted to diverge: its changes grow by a factor of {growth:.3f} per cycle; "
            f"{_cure(config, scenario)} (warn=false skips this check)"
        )
