"""A warning before a long run whose learning will diverge."""

from dataclasses import replace

from cmacexp.config import Config
from cmacexp.config.schema import NONE
from cmacexp.loop.builtin import find_external
from cmacexp.loop.scenario import Scenario, resolve_lead
from cmacexp.plants import AnalyticPlant
from cmacexp.report.terminal import activity

MIN_LEARNING_CYCLES = 100
"""Cycles of learning from which on a run is checked: up to 1,000 cycles in memory and linearising take 0.1 to 0.5 s
for one leg and 2 to 4 s for the quadruped; where learning grows, each of at most three other leads as long."""
MAX_STEPS_PER_CYCLE = 5_000
"""Steps of all legs in a cycle above which the check is skipped: it would take longer still."""
MIN_TOTAL_GROWTH = 10.0
"""A run whose feedback is predicted to grow by less over all its cycles is not warned of."""


def _is_checked(config: Config, scenario: Scenario) -> bool:
    steps = config.steps_per_cycle * len(scenario.setup.mechanism.legs) * getattr(config.plant, "substeps", 1)
    enough = config.cycles - config.learning.start_cycle >= MIN_LEARNING_CYCLES
    quick = steps <= MAX_STEPS_PER_CYCLE and isinstance(scenario.plant, AnalyticPlant)
    return config.warn and enough and quick and not any(find_external(scenario))


def _cure(config: Config, scenario: Scenario) -> str:
    """A sentence that names a lead with which learning holds."""
    from cmacexp.stability.growth import with_lead
    from cmacexp.stability.verdict import HOLDS, assess

    own = scenario.setup.lead
    automatic = resolve_lead(replace(config, learning=replace(config.learning, lead="auto")), scenario.sensors)
    tried = [lead for lead in dict.fromkeys((automatic, own + 1, own - 1)) if lead != own]
    for lead in tried:
        if assess(with_lead(config, lead)).verdict == HOLDS:
            return f"learning.lead={lead} is predicted to hold"
    leads = " and ".join(map(str, tried))
    return f"learning.lead={leads} would not surely hold either; try learning.rule=weight_smoothing"


def growth_warning(config: Config, scenario: Scenario) -> str | None:
    """The warning before a run; None if its learning may hold, the run is short, or nothing can be predicted.

    Args:
        config: of the run.
        scenario: its components, which stay unchanged.
    """
    if not _is_checked(config, scenario):
        return None
    from cmacexp.stability.verdict import BOUNDED_RULES, GROWS, assess

    if config.learning.rule in BOUNDED_RULES:
        return None
    with activity("checking whether learning holds"):
        verdict = assess(config, scenario)
        ends = 0 < verdict.ends <= config.cycles
        fast = verdict.growth ** (config.cycles - config.learning.start_cycle) >= MIN_TOTAL_GROWTH
        if verdict.verdict != GROWS or not (ends or fast):
            return None
        grows = f"its changes grow by a factor of {verdict.growth:.3f} per cycle"
        if not fast:
            grows = f"the run ends in cycle {verdict.ends}"
        guard, cure = config.learning.guard, _cure(config, scenario)
        what = "learning is predicted to diverge"
        if guard != NONE:
            what = f"learning.guard={guard} is predicted to end learning, which would diverge"
        return f"warning: {what}: {grows}; {cure} (warn=false skips this check)"
