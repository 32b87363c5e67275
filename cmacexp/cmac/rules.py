"""Learning rules for networks that are linear in their weights: combinations of learning error, divisor and goal.

Every rule changes only the active weights. It adds beta e a_j / d to each, where e is the learning error and d the
divisor, and moves the weight a fraction of the way to the goal. The paper's rule (Lin & Song 1997, eq. 20) has the
feedback torque U as error and sum a_i^2 as divisor, without a goal; the others are listed in :data:`RULES`. A rule
that also trains neighbouring steps filters the error over time by a zero-phase low-pass.
"""

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from cmacexp.config.cmac import NEEDS_LEARNING
from cmacexp.errors import BadInput, require, require_name
from cmacexp.jit.compiler import called_kernel, kernel, program
from cmacexp.typing import Array, Cells

MOST_ENTRIES = 2**27
"""Largest number of active weights in :func:`spread_shares`, over all steps of a cycle and their neighbours."""


def binomial(window: int) -> Array:
    """Compute the taps (2 x window + 1,), without a unit, of the binomial filter; their sum is 1.

    Its gain at frequency f is cos(pi f T_s)^(2 x window), never negative and without side lobes: it inverts the sign
    of no error component and attenuates fast ones.
    """
    taps = np.ones(1)
    for _ in range(2 * window):
        taps = np.convolve(taps, [0.5, 0.5])
    return taps


def spread_shares(cells: Cells, activation: Array, window: int) -> tuple[Cells, Array]:
    """Compute the rows of weights that learn from the error of each sample, and their shares, (N, L, K) each.

    ``cells`` (N, L, C) are the active rows at each sample of the cycle, ``activation`` (N, L, C) their activations;
    ``window`` is the number of neighbouring samples on each side. The share of a weight is the sum of
    g_m a_j / sum a_i^2 over the neighbouring samples in which it is active, with g_m the taps of :func:`binomial`;
    unused entries at the end are 0. Raises BadInput if the window is wider than the cycle, or if it leads to too many
    weights.
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
    spread = {}
    for k, i in np.ndindex(samples, legs):
        around = np.arange(k - window, k + window + 1) % samples
        rows, index = np.unique(cells[around, i], return_inverse=True)
        total = np.bincount(index.ravel(), taps * share[around, i].ravel())
        spread[k, i] = rows[total > 0.0], total[total > 0.0]
    shape = samples, legs, max(1, *(len(rows) for rows, _ in spread.values()))
    spread_cells = np.zeros(shape, dtype=cells.dtype)
    shares = np.zeros(shape)
    for sample_leg, (rows, total) in spread.items():
        spread_cells[sample_leg][: len(rows)] = rows
        shares[sample_leg][: len(rows)] = total
    return spread_cells, shares


@called_kernel
def train_spread(weights: Array, cells: Cells, share: Array, error: Array, rate: float, leakage: float) -> None:
    """Add beta s_j (U - leakage W_j) to every weight that learns from the error of a sample.

    Changes the rows ``cells`` (K,) of ``weights`` (rows, outputs). ``share`` (K,) is s_j, whose first zero marks the
    end; ``error`` (outputs,) is U, N m; ``rate`` is beta. ``leakage`` is that of one weight: C times that of an
    output, which is the sum of C equal weights.
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
"""Learning errors: U; U where abs(U) > strength; U, also of neighbouring steps."""
POWER, REGULARISED = range(2)
"""Divisors: sum a_i^2; sum a_i^2 + strength x its mean."""
NO_GOAL, ZERO, ZERO_BY_ERROR, MEAN = range(4)
"""Goals: none; 0; 0, in proportion to abs(U); the mean of the active weights."""
CONSTANT, DECAYING = range(2)
"""Rates: beta; beta / (1 + cycles / strength)."""


class RuleParams(NamedTuple):
    """Learning rule as a combination of choices, with the strength of its difference from the paper's rule."""

    teaches: int = ERROR
    """Learning error: ERROR, OUTSIDE_DEAD_ZONE or NEIGHBOURS."""
    divisor: int = POWER
    """Divisor: POWER or REGULARISED."""
    goal: int = NO_GOAL
    """Goal to which weights decay, by a fraction beta x strength per step: NO_GOAL, ZERO, ZERO_BY_ERROR or MEAN."""
    rate: int = CONSTANT
    """Learning rate: CONSTANT or DECAYING."""
    strength: float = 0.0
    """Strength of the rule, in the unit of its field of :class:`LearningConfig`."""


class Rule(NamedTuple):
    """Learning rule with its source."""

    source: str
    """Publication that proposes it."""
    strength: str = ""
    """Field of :class:`LearningConfig` with its strength; empty: none."""
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
    """Return the conditions under which a field of :class:`LearningConfig` has an effect as the strength of a rule.

    ``key`` is the name of the field, with or without ``learning.``. Empty if it is not the strength of any rule.
    """
    field = key.removeprefix("learning.")
    names = tuple(
        name
        for name, rule in RULES.items()
        if field == rule.strength or (field == "window" and rule.params.teaches == NEIGHBOURS)
    )
    return (f"learning.rule in {names}", *NEEDS_LEARNING) if names else ()


def find_rule(name: str) -> Rule:
    """Return the rule with a ``name`` of RULES; raises BadInput for another name."""
    require_name("learning.rule", name, RULES)
    return RULES[name]


def make_rule(config: "LearningConfig", activation: Array) -> RuleParams:
    """Make the parameters of the rule of a config, for a network with ``activation`` (N, L, C) along the plan.

    The strength of rules that divide by the power of the activations is scaled by its mean. Raises BadInput if the
    network has only one active weight at a time and the rule draws weights to their mean.
    """
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
"""Learning rate beta of Lin & Song 1997."""


def derive_rate(lead: int) -> float:
    """Compute the learning rate of ``learning.rate=auto`` from the ``lead`` in samples.

    It is the paper's rate up to a lead of one sample; beyond, rate x (lead - 1/2) is constant. Neighbouring samples
    share weights, so within a cycle learning acts as a sampled integrator. At its crossover frequency the phase lag
    is 90 degrees plus rate x (lead + 1/2) rad, which is 17 degrees with lead 1 and less with a larger lead.
    """
    return PAPER_RATE / max(1, 2 * lead - 1)


@kernel
def rate_after(rule: RuleParams, rate: float, cycles: int) -> float:
    """Return the learning rate after ``cycles`` cycles, from its initial ``rate``.

    For a DECAYING rate the sum over cycles diverges and the sum of squares converges (Robbins & Monro).
    """
    return rate / (1.0 + cycles / rule.strength) if rule.rate == DECAYING else rate


@kernel
def compute_learning_error(rule: RuleParams, error: float) -> float:
    """Return the learning error for a feedback ``error``, N m: 0 in the dead zone of a rule with one."""
    return 0.0 if rule.teaches == OUTSIDE_DEAD_ZONE and abs(error) <= rule.strength else error


@kernel
def compute_divisor(rule: RuleParams, power: float) -> float:
    """Return the divisor of a rule for a ``power``, sum a_i^2; regularisation slows learning at low power."""
    return power + rule.strength if rule.divisor == REGULARISED else power


@kernel
def compute_goal(rule: RuleParams, weights: Array, cells: Cells, activation: Array, power: float, o: int) -> float:
    """Compute the goal of the active weights of output ``o``, N m: 0, or their mean with goal MEAN.

    ``cells`` (C,) are the active rows of ``weights`` (rows, J), ``power`` is sum a_i^2. The mean is weighted by
    a_i^2, so that moving weights towards it does not change the output.
    """
    goal = 0.0
    if rule.goal == MEAN:
        for j in range(cells.shape[0]):
            goal += activation[j] * activation[j] * weights[cells[j], o]
        goal /= power
    return goal


@kernel
def pull(rule: RuleParams, rate: float, error: float) -> float:
    """Return the fraction, 0 to 1, of its distance to the goal that the most active weight moves in one step."""
    if rule.goal == NO_GOAL:
        return 0.0
    return min(1.0, rate * rule.strength * (abs(error) if rule.goal == ZERO_BY_ERROR else 1.0))


@called_kernel
def train_by_rule(
    rule: RuleParams, weights: Array, cells: Cells, activation: Array, error: Array, rate: float
) -> None:
    """Train the active weights by one step, each in proportion to its ``activation`` (C,), 0 or more.

    Changes the rows ``cells`` (C,) of ``weights`` (rows, outputs); ``error`` (outputs,) is U, the feedback torque,
    N m, and ``rate`` is beta. For rules that train neighbouring steps see :func:`train_spread`.
    """
    power = largest = 0.0
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
    """Train ``weights`` (rows, J) with a batch, one sample after the other, see :func:`train_by_rule`.

    ``cells`` and ``activation`` are (samples, C), ``error`` is (samples, J), N m.
    """
    for k in range(cells.shape[0]):
        train_by_rule(rule, weights, cells[k], activation[k], error[k], rate)
