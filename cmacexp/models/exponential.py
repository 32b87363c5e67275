"""The exponential of arrays, with the same bits on every processor."""

import math

import numpy as np

exponential = np.vectorize(math.exp, otypes=[float])
"""e^x of each element, by the C library: numpy's own gives other bits where the processor has AVX-512."""
