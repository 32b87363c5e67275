"""Array types that the whole project shares."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Cells = NDArray[np.uint32]
"""Rows of CMAC memory; without a sign, so that compiled code need not look for rows that count from the end."""
