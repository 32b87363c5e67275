"""Learning rules beyond the paper's, for any network that is linear in its weights; as compiled kernels.

All of them change the active weights alone: beta U a_j / sum a_i^2, as the paper does (eq. 20), and each does one
thing otherwise, to the strength of one field of the config. ``zero_phase``, the project's own, also teaches the
steps around: see :mod:`cmacexp.cmac.spread`.
"""

from cmacexp.config.schema import LearningConfig
from cmacexp.jit.compiler import kernel, kernel_apart
from cmacexp.typing import Array, Cells

PAPER, NORMALISED, DEAD_ZONE, LEAKAGE, E_MODIFICATION, WEIGHT_SMOOTHING, DECAYING_RATE, ZERO_PHASE = range(8)

RULES = {
    "paper": (PAPER, ""),
    "normalised": (NORMALISED, "regularisation"),
    "dead_zone": (DEAD_ZONE, "dead_zone"),
    "leakage": (LEAKAGE, "leakage"),
    "e_modification": (E_MODIFICATION, "e_modification"),
    "weight_smoothing": (WEIGHT_SMOOTHING, "smoothing"),
    "decaying_rate": (DECAYING_RATE, "decay"),
    "zero_phase": (ZERO_PHASE, "leakage"),
}
"""Number of every rule, and the config field of its strength."""


def strength_of(config: LearningConfig) -> float:
    """What the rule of ``config`` does otherwise than the paper's, in the unit of its field; 0 for the paper's."""
    _, name = RULES[config.rule]
    return float(getattr(config, name)) if name else 0.0


@kernel
def rate_in_cycle(rule: int, strength: float, rate: float, cycles: int) -> float:
    """beta after ``cycles`` cycles of learning: constant, or beta / (1 + cycles/decay).

    Its sum is infinite, that of its squares finite (Robbins & Monro 1951); the form is that of Darken & Moody 1991,
    "Note on learning rate schedules for stochastic optimization".
    """
    return rate / (1.0 + cycles / strength) if rule == DECAYING_RATE else rate


@kernel
def effective_error(rule: int, strength: float, error: float) -> float:
    """What of the ``error`` teaches, N m: nothing in the dead zone (Peterson & Narendra 1982)."""
    return 0.0 if rule == DEAD_ZONE and abs(error) <= strength else error


@kernel
def added_power(rule: int, strength: float) -> float:
    """What is added to sum a_i^2, so that hardly active weights are not learnt in leaps (Nagumo & Noda 1967)."""
    return strength if rule == NORMALISED else 0.0


@kernel
def pull(rule: int, strength: float, rate: float, error: float) -> float:
    """Share of its way to the goal that the most active weight is drawn at once, 0 to 1.

    Leakage (sigma modification, Ioannou & Kokotovic 1984) draws to zero, e-modification (Narendra & Annaswamy 1987)
    too, but the less, the smaller the error; weight smoothing (Macnab 2017, doi:10.1007/s00521-017-3182-6) draws to
    the mean of the active weights.
    """
    if rule in (LEAKAGE, WEIGHT_SMOOTHING):
        return min(1.0, rate * strength)
    if rule == E_MODIFICATION:
        return min(1.0, rate * strength * abs(error))
    return 0.0


@kernel_apart
def train_by_rule(
    rule: int, strength: float, weights: Array, cells: Cells, activation: Array, error: Array, rate: float
) -> None:
    """One step of a rule: to every active weight add beta U a_j / sum a_i^2, and draw it to the rule's goal.

    A weight is drawn in proportion to its activation, and the mean weighs by a_i^2: so smoothing leaves the output at
    these cells as it is, whatever the activations are, and where all are one it is the plain mean.

    Args:
        rule: number of the rule.
        strength: of the rule.
        weights: (rows, outputs): changed in place.
        cells: (C,): active rows.
        activation: (C,): how much each of them counts, 0 or more.
        error: (outputs,): U, the output of the feedback controller, N m.
        rate: beta.
    """
    power, largest = 0.0, 0.0
    for j in range(cells.shape[0]):
        power += activation[j] * activation[j]
        largest = max(largest, activation[j])
    if power > 0.0:
        for o in range(error.shape[0]):
            goal = 0.0
            if rule == WEIGHT_SMOOTHING:
                for j in range(cells.shape[0]):
                    goal += activation[j] * activation[j] * weights[cells[j], o]
                goal /= power
            share = rate * effective_error(rule, strength, error[o]) / (power + added_power(rule, strength))
            drawn = pull(rule, strength, rate, error[o]) / largest
            for j in range(cells.shape[0]):
                weight = weights[cells[j], o]
                weights[cells[j], o] = weight + share * activation[j] + drawn * activation[j] * (goal - weight)
