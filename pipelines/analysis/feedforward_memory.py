"""How many bytes a feedforward holds, and how many of them the path uses."""

import numpy as np

from cmacexp.config.cmac import OUTPUTS, WORD_BYTES
from cmacexp.data.stored_run import StoredRun
from cmacexp.data.weights import WEIGHTS


def bytes_of(run: StoredRun) -> tuple[int, int]:
    """Bytes of one leg of a run of one leg: all that it keeps, and what of it the path reads; 0 without weights.

    What is read on the way to the weights (ranges, centres) counts as used.
    """
    if WEIGHTS not in run.manifest["files"]:
        return 0, 0
    with np.load(run.folder / WEIGHTS) as arrays:
        held = sum(array.nbytes for array in arrays.values())
    idle = sum(use["rows"] - use["rows_used"] for use in run.manifest["memory"])
    return held, held - idle * OUTPUTS * WORD_BYTES
