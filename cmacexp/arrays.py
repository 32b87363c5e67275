"""Array types that the whole project shares."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Cells = NDArray[np.signedinteger[Any]]
"""Rows of CMAC memory."""
