"""Damage of files."""

import random
from pathlib import Path

import numpy as np
import pyarrow as pa

BAD_TEXTS = pa.StringArray.from_buffers(2, pa.py_buffer(np.arange(3, dtype=np.int32)), pa.py_buffer(b"\xff\xff"))
"""Two texts that are not UTF-8."""


def flip(path: Path, chance: random.Random) -> None:
    """Change one bit of a file."""
    data = bytearray(path.read_bytes())
    data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
    path.write_bytes(data)
