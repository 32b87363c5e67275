"""Learning rules for any network that is linear in its weights: what teaches x divisor x goal.

Every rule changes only the active weights. To each it adds beta e a_j / d, with e what teaches and d the divisor, and
it moves the weight a fraction of the way to the goal. The paper's rule (Lin & Song 1997, eq. 20) is the feedback
torque U over sum a_i^2, without a goal; the others are listed in :data:`RULES`. Where the error at neighbouring steps
teaches too, a low-pass without phase filters it over time.
"""

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from cmacexp.config.cmac import NEEDS_LEARNING
from cmacexp.errors import BadInput, require, require_name
from cmacexp.jit.compiler import called_kernel, kernel, program
from cmacexp.typing import Array, Cells

MOST_ENTRIES = 2**27
"""Largest number of active weights, over all steps of a cycle and their neighbours, in :func:`spread_shares`."""


def binomial(window: int) -> Array:
    """Taps (2 x window + 1,), without a unit, of the binomial filter; their sum is 1.

    Its gain at frequency f is cos(pi f T_s)^(2 x window), which is never negative and has no side lobes: it reverses
    no error and attenuates fast ones.
    """
    taps = np.ones(1)
    for _ in range(2 * window):
        taps = np.convolve(taps, [0.5, 0.5])
    return taps


def spread_shares(cells: Cells, activation: Array, window: int) -> tuple[Cells, Array]:
    """Weights that learn from the error of each sample, and their shares, (N, L, K) each.

    ``cells`` (N, L, C) are the active weights of each sample of the cycle, with their ``activation``; ``window`` is
    that of samples on each side. The share of a weight is the sum of g_m a_j / sum a_i^2 over the neighbouring
    samples in which it is active; zeros follow the last one. Raises BadInput if the window is wider than the cycle,
    or gives too many weights.
    """
    samples, legs, active = cells.shape
    require(
        2 * window + 1 <= samples,
        "learning.window",
        window,
        f"must be below {(samples + 1) // 2}, half the samples of a cycle",
    )
    if cells.size * (2 * window + 1) > MOST_ENTRIES:
        allowed = f"must be below {MOST_ENTRIES // (2 * cells.size)} with this network"
        raise BadInput("learning.window", window, allowed)
    power = (activation**2).sum(axis=2, keepdims=True)
    share = np.divide(activation, power, out=np.zeros_like(activation), where=power > 0.0)
    taps = np.repeat(binomial(window), active)
    found = []
    for k in range(samples):
        around = np.arange(k - window, k + window + 1) % samples
        for i in range(legs):
            rows, place = np.unique(cells[around, i], return_inverse=True)
            total = np.bincount(place.ravel(), taps * share[around, i].ravel())
            found.append((rows[total > 0.0], total[total > 0.0]))
    most = max(1, *(len(rows) for rows, _ in found))
    shape = (samples * legs, most)
    spread_cells, shares = np.zeros(shape, dtype=cells.dtype), np.zeros(shape)
    for n, (rows, total) in enumerate(found):
        spread_cells[n, : len(rows)], shares[n, : len(rows)] = rows, total
    return spread_cells.reshape(samples, legs, most), shares.reshape(samples, legs, most)


@called_kernel
def train_spread(weights: Array, cells: Cells, share: Array, error: Array, rate: float, leakage: float) -> None:
    """Add beta s_j (U - leakage W_j) to every weight that learns from the error.

    Changes the rows ``cells`` (K,) of ``weights`` (rows, outputs) by their ``share`` (K,), s_j, of which the first
    zero marks the end, of ``error`` (outputs,), U, N m. ``leakage`` is that of one weight: C times that of an output,
    which is the sum of C equal weights.
    """
    for j in range(cells.shape[0]):
        if share[j] == 0.0:
            return
        for o in range(error.shape[0]):
            weight = weights[cells[j], o]
            weights[cells[j], o] = weight + rate * share[j] * (error[o] - leakage * weight)


if TYPE_CHECKING:
    from cmacexp.config.schema import LearningConfig

ERROR, OUTSIDE_DEAD_ZONE, NEIGHBOURS = range(3)
"""What teaches: U; U where abs(U) > strength; U, also at neighbouring steps."""
POWER, REGULARISED = range(2)
"""Divisors: sum a_i^2; sum a_i^2 + strength x its mean."""
NO_GOAL, ZERO, ZERO_BY_ERROR, MEAN = range(4)
"""Goals: none; 0; 0, in proportion to abs(U); the mean of the active weights."""
CONSTANT, DECAYING = range(2)
"""Rates: beta; beta / (1 + cycles / strength)."""


class RuleParams(NamedTuple):
    """A combination of choices, and the strength of what differs from the paper's rule."""

    teaches: int = ERROR
    """What teaches: ERROR, OUTSIDE_DEAD_ZONE or NEIGHBOURS."""
    divisor: int = POWER
    """POWER or REGULARISED."""
    goal: int = NO_GOAL
    """NO_GOAL, ZERO, ZERO_BY_ERROR or MEAN: where the weights are drawn, by beta times the strength in each step."""
    rate: int = CONSTANT
    """CONSTANT or DECAYING."""
    strength: float = 0.0


class Rule(NamedTuple):
    """A learning rule as data."""

    source: str
    strength: str = ""
    """Field of :class:`LearningConfig` that holds its strength; empty: none."""
    params: RuleParams = RuleParams()


RULES = {
    "paper": Rule("Lin & Song 1997, eq. 20"),
    "normalised": Rule("Nagumo & Noda 1967", "regularisation", RuleParams(divisor=REGULARISED)),
    "dead_zone": Rule("Peterson & Narendra 1982", "dead_zone", RuleParams(teaches=OUTSIDE_DEAD_ZONE)),
    "leakage": Rule("sigma modification, Ioannou & Kokotovic 1984", "leakage", RuleParams(goal=ZERO)),
    "e_modification": Rule("Narendra & Annaswamy 1987", "e_modification", RuleParams(goal=ZERO_BY_ERROR)),
    "weight_smoothing": Rule("Macnab 2017, doi:10.1007/s00521-017-3182-6", "smoothing", RuleParams(goal=MEAN)),
    "decaying_rate": Rule("Robbins & Monro 1951; Darken & Moody 1991", "decay", RuleParams(rate=DECAYING)),
    "zero_phase": Rule("this project", "leakage", RuleParams(teaches=NEIGHBOURS, goal=ZERO)),
}


PAPER = RULES["paper"].params


def strength_needs(key: str) -> tuple[str, ...]:
    """What a field of :class:`LearningConfig` that is the strength of rules needs to have an effect."""
    field = key.removeprefix("learning.")
    names = tuple(
        name
        for name, rule in RULES.items()
        if field == rule.strength or (field == "window" and rule.params.teaches == NEIGHBOURS)
    )
    return (f"learning.rule in {names}", *NEEDS_LEARNING) if names else ()


def find_rule(name: str) -> Rule:
    """The rule of that name; raises BadInput."""
    require_name("learning.rule", name, RULES)
    return RULES[name]


def make_rule(config: "LearningConfig", activation: Array) -> RuleParams:
    """The rule of a config, for a network with ``activation`` (N, L, C) along the plan; raises BadInput."""
    rule = find_rule(config.rule)
    strength = float(vars(config)[rule.strength]) if rule.strength else 0.0
    if rule.params.goal == MEAN and activation.shape[2] == 1:
        allowed = (
            "draws active weights to their mean, but this network has one active weight at a time; "
            "use at least 2 (cmac.layers), or another rule"
        )
        raise BadInput("learning.rule", config.rule, allowed)
    if rule.params.divisor == REGULARISED or rule.params.teaches == NEIGHBOURS:
        power = (activation**2).sum(axis=2)
        strength *= math.fsum(power.flat) / power.size
    return rule.params._replace(strength=strength)


PAPER_RATE = 50 / 256
"""beta of Lin & Song 1997."""


def derive_rate(lead: int) -> float:
    """``learning.rate=auto``: the paper's at a lead of up to one sample; then rate x (lead - 1/2) stays the same.

    Neighbouring samples share weights, so that within a cycle learning acts as a sampled integrator. Its phase lag
    where its gain is 1 is 90 degrees and rate x (lead + 1/2) rad: 17 degrees with lead 1, less with more.
    """
    return PAPER_RATE / max(1, 2 * lead - 1)


@kernel
def rate_after(rule: RuleParams, rate: float, cycles: int) -> float:
    """The rate after ``cycles`` cycles; the sum of a decaying one diverges, that of its squares converges."""
    return rate / (1.0 + cycles / rule.strength) if rule.rate == DECAYING else rate


@kernel
def compute_learning_error(rule: RuleParams, error: float) -> float:
    """The part of ``error``, N m, that teaches."""
    return 0.0 if rule.teaches == OUTSIDE_DEAD_ZONE and abs(error) <= rule.strength else error


@kernel
def compute_divisor(rule: RuleParams, power: float) -> float:
    """The divisor for ``power``, sum a_i^2; with regularisation, weights that are hardly active learn slowly."""
    return power + rule.strength if rule.divisor == REGULARISED else power


@kernel
def compute_goal(rule: RuleParams, weights: Array, cells: Cells, activation: Array, power: float, o: int) -> float:
    """The goal of the weights (rows, J) of output ``o``, N m, that are active: at ``cells`` (C,).

    A mean weighs by a_i^2, so that drawing keeps the output.
    """
    goal = 0.0
    if rule.goal == MEAN:
        for j in range(cells.shape[0]):
            goal += activation[j] * activation[j] * weights[cells[j], o]
        goal /= power
    return goal


@kernel
def pull(rule: RuleParams, rate: float, error: float) -> float:
    """Fraction of the way to the goal that the most active weight moves in one step, 0 to 1."""
    if rule.goal == NO_GOAL:
        return 0.0
    return min(1.0, rate * rule.strength * (abs(error) if rule.goal == ZERO_BY_ERROR else 1.0))


@called_kernel
def train_by_rule(
    rule: RuleParams, weights: Array, cells: Cells, activation: Array, error: Array, rate: float
) -> None:
    """One step of learning: every active weight changes in proportion to its ``activation`` (C,), 0 or more.

    Changes the rows ``cells`` (C,) of ``weights`` (rows, outputs) by ``error`` (outputs,), U, the output of the
    feedback controller, N m. For rules that teach neighbouring steps see :func:`cmacexp.cmac.rules.train_spread`.
    """
    power, largest = 0.0, 0.0
    for j in range(cells.shape[0]):
        power += activation[j] * activation[j]
        largest = max(largest, activation[j])
    if power > 0.0:
        for o in range(error.shape[0]):
            goal = compute_goal(rule, weights, cells, activation, power, o)
            step = rate * compute_learning_error(rule, error[o]) / compute_divisor(rule, power)
            drawn = pull(rule, rate, error[o]) / largest
            for j in range(cells.shape[0]):
                weight = weights[cells[j], o]
                weights[cells[j], o] = weight + step * activation[j] + drawn * activation[j] * (goal - weight)


@program
def train_batch(rule: RuleParams, weights: Array, cells: Cells, activation: Array, error: Array, rate: float) -> None:
    """:func:`train_by_rule` for a batch, one sample after the other.

    ``weights`` (rows, J) change; ``cells`` and ``activation`` are (samples, C), ``error`` is (samples, J), N m.
    """
    for k in range(cells.shape[0]):
        train_by_rule(rule, weights, cells[k], activation[k], error[k], rate)
