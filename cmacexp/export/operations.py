"""Operations of one step of the exported C code, at most: what a processor must have time for."""

from cmacexp.cmac.receptive_field import RECEPTIVE_FIELDS
from cmacexp.cmac.rules import DECAYING, MEAN, NO_GOAL, REGULARISED, ZERO_BY_ERROR
from cmacexp.export.network import Network

SPLINE = {"linear": (2, 1), "cubic": (3, 7)}
"""Additions and multiplications of a B-spline, at most."""


def count_operations(network: Network) -> dict[str, int]:
    """Operations of one step, at most, all legs: of numbers, of integers (about), and words of memory."""
    params, rule = network.params, network.params.learning.rule
    (legs, _, joints), layers, inputs = params.weights.shape, params.cells.shape[2], network.inputs.shape[2]
    weighted, goal = int(network.is_weighted), rule.goal != NO_GOAL
    add, multiply = layers * joints, weighted * layers * joints  # to predict
    add += joints * (network.known is not None)
    add, multiply = add + weighted * layers, multiply + weighted * layers  # the power
    per_joint = [
        1 + (rule.divisor == REGULARISED),
        1 + goal * (1 + (rule.goal == ZERO_BY_ERROR)),
        1 + goal * weighted,
    ]
    per_joint[0] += layers * (1 + 2 * goal)
    per_joint[1] += layers * (weighted + goal * (1 + weighted))
    if rule.goal == MEAN:
        per_joint = [per_joint[0] + layers, per_joint[1] + 2 * weighted * layers, per_joint[2] + 1]
    add, multiply, divide = add + joints * per_joint[0], multiply + joints * per_joint[1], joints * per_joint[2]
    integer = 2 * layers * joints
    if network.addresses:
        add, multiply, divide = add + 2 * inputs, multiply + inputs, divide + inputs
        integer += layers * inputs * (8 if network.addresses[0].hashed else 5) + 12 * layers
        integer += layers * 5 * params.weights.shape[1].bit_length() * bool(network.places)
        if weighted:
            name = next(key for key, value in RECEPTIVE_FIELDS.items() if value == network.field)
            added, multiplied = SPLINE[name]
            add += layers * (inputs * (2 + added) + 1)
            multiply += layers * (inputs * (1 + multiplied) + 1)
            divide += layers * (inputs + 1)
    decays = rule.rate == DECAYING
    return {
        "add": legs * add + decays,
        "multiply": legs * multiply,
        "divide": legs * divide + 2 * decays,
        "integer": legs * integer,
        "weights": legs * layers * joints,
        "trained": legs * layers * joints,
    }
