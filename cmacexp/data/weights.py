"""Learnt weights of a feedforward, stored in a file from which another run can start."""

from pathlib import Path

import numpy as np

from cmacexp.config import Config, to_plain
from cmacexp.config.describe import differences
from cmacexp.data.files import open_file
from cmacexp.data.manifest import require_intact
from cmacexp.data.run import Run
from cmacexp.data.tables import WEIGHTS as WEIGHTS
from cmacexp.errors import BadInput, BadRun
from cmacexp.typing import Weights

MAX_BYTES = 4 << 30
"""Largest total size of the arrays, B: four networks with the largest memory, see :mod:`cmacexp.config.cmac`."""


def read_weights(config: Config) -> Weights | None:
    """Read the weights that a feedforward starts from, by array name; None without ``learning.start_from``.

    Raises BadInput if the run there stored no weights, or if they are of another network than that of ``config``.
    """
    if config.learning.start_from is None:
        return None
    folder = Path(config.learning.start_from)
    try:
        weights = load_weights(folder)
        networks = [
            {
                "machine": {"kind": plain["machine"]["kind"]},
                "feedforward": plain["feedforward"],
                "cmac": plain["cmac"],
            }
            for plain in (Run(folder).config, to_plain(config))
        ]  # weights mean nothing to another machine or network
        if differing := differences(networks)[0]:
            there = " ".join(f"{key}={value}" for key, value in differing.items())
            raise BadRun(f"its weights were learnt with {there}; give the same here")
    except BadRun as error:
        raise BadInput(
            "learning.start_from",
            folder,
            f"must be the folder of a run with record.weights=true, and with this network ({error})",
        ) from None
    return weights


def load_weights(folder: Path) -> Weights:
    """Read the weights that the run in ``folder`` stored, by array name; raises BadRun."""
    _ = Run(folder).manifest  # raises BadRun without one: the weights could not be checked
    path = require_intact(folder / WEIGHTS)
    try:
        with open_file(path) as file, np.load(file, allow_pickle=False) as arrays:
            if sum(array.file_size for array in arrays.zip.infolist()) > MAX_BYTES:
                raise ValueError(f"its arrays have more than {MAX_BYTES} B")
            weights = dict(arrays)
        if other := [name for name, array in weights.items() if array.dtype.kind not in "fiu"]:
            raise ValueError(f"{other[0]} holds no numbers")
    except Exception as error:  # zipfile, zlib and numpy raise many kinds for a file of another program
        raise BadRun(f"{path}: cannot be read ({error}); run it again") from None
    return weights
