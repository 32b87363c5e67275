"""What docs/theory.md says is proven of learning behind a pure delay of as many samples as the lead."""

import math

import numpy as np
import pytest

from cmacexp.cmac.memory import read, train

SAMPLES, LAYERS, WIDTH = 40, 8, 10
CELLS = np.array([[(k + j) // WIDTH * LAYERS + j for j in range(LAYERS)] for k in range(SAMPLES)], dtype=np.uint32)


def squares_of_weights(lead, rate, cells=CELLS, steps=4000):
    """|w|^2 after each step; the feedback is minus the feedforward ``lead`` samples ago."""
    weights = np.random.default_rng(0).standard_normal((int(cells.max()) + 1, 2))
    outputs, squares = np.zeros((steps, 2)), []
    for n in range(steps):
        read(weights, cells[n % SAMPLES], outputs[n])
        train(weights, cells[(n - lead) % SAMPLES], -outputs[n - lead] * (n >= lead), rate)
        squares.append(float((weights**2).sum()))
    return np.array(squares), outputs


@pytest.mark.parametrize("lead", [1, 2, 4])
def test_no_cmac_grows_within_condition_2_and_shared_cells_do_beyond_the_critical_rate(lead):
    squares, outputs = squares_of_weights(lead, 0.95 / (lead + 0.5))
    assert squares.max() <= squares[0]
    assert np.abs(outputs[-SAMPLES:]).max() < 0.1 * np.abs(outputs[:SAMPLES]).max()
    critical = 2.0 * math.sin(math.pi / (4 * lead + 2))
    shared = np.zeros_like(CELLS) + CELLS[:1]
    for share, grows in ((0.95, False), (1.05, True)):
        assert (squares_of_weights(lead, share * critical, shared)[0][-1] > squares[0]) == grows
