"""Array types that the whole project shares."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Counts = NDArray[np.int64]
Cells = NDArray[np.unsignedinteger[Any]]
"""Rows of CMAC memory; without a sign, so that compiled code need not look for rows that count from the end."""


Weights = Mapping[str, NDArray[Any]]
"""What a feedforward has learnt, and the law by which it is addressed: arrays by name."""
