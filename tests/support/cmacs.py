"""Small CMACs over inputs from -1 to 1, and inputs for them."""

import numpy as np

from cmacexp.cmac import Cmac


def make_cmac(inputs=2, outputs=2, layers=8, cells=5, **options):
    return Cmac(-np.ones(inputs), np.ones(inputs), outputs, layers, cells, **options)


def random_inputs(samples, inputs=2, seed=0, reach=1.0):
    return reach * np.random.default_rng(seed).uniform(-1.0, 1.0, (samples, inputs))
