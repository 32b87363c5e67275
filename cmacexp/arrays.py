"""Array types that the whole project shares."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Cells = NDArray[np.int32]
"""Rows of CMAC memory."""
