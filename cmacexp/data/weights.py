"""Learnt weights of a feedforward, as a file from which another run can start."""

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
"""Largest size of all arrays together: four networks of the largest memory, see :mod:`cmacexp.config.cmac`."""


def read_weights(config: Config) -> Weights | None:
    """The weights that a feedforward starts from, None without ``learning.start_from``; raises BadInput."""
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
        ]  # on which the meaning of weights depends
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
    """The weights that the run in a folder stored; raises BadRun."""
    _ = Run(folder).manifest  # without one there is nothing that they could be compared with
    path = require_intact(folder / WEIGHTS)
    try:
        with open_file(path) as file, np.load(file, allow_pickle=False) as arrays:
            if sum(array.file_size for array in arrays.zip.infolist()) > MAX_BYTES:
                raise ValueError(f"its arrays have more than {MAX_BYTES} B")
            weights = dict(arrays)
        if other := [name for name, array in weights.items() if array.dtype.kind not in "fiu"]:
            raise ValueError(f"{other[0]} holds no numbers")
    except Exception as error:  # whatever zipfile, zlib and numpy raise for a file that nobody wrote with them
        raise BadRun(f"{path}: cannot be read ({error}); run it again") from None
    return weights
