"""Learnt weights of a feedforward, as a file from which another run can start."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from cmacexp.config import Config, to_plain
from cmacexp.config.difference import differences
from cmacexp.data import manifest as manifests
from cmacexp.data.files import write_atomically
from cmacexp.data.hashes import current_hash, require_intact
from cmacexp.errors import BadInput, BadRun
from cmacexp.typing import Weights

WEIGHTS = "weights.npz"


def write_weights(folder: Path, weights: Weights) -> None:
    """Write ``weights`` to the folder of a run; equal arrays give equal bytes."""
    with write_atomically(folder / WEIGHTS) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **weights)


def _network(config: Mapping[str, Any]) -> dict[str, Any]:
    """The part of a plain config on which the meaning of weights depends."""
    return {
        "machine": {"kind": config["machine"]["kind"]},
        "feedforward": config["feedforward"],
        "cmac": config["cmac"],
    }


def read_weights(config: Config) -> Weights | None:
    """The weights that the feedforward of a run starts from; None without ``learning.start_from``.

    Raises:
        BadInput: ``learning.start_from`` is no run of the same feedforward with stored weights.
    """
    if config.learning.start_from is None:
        return None
    folder = Path(config.learning.start_from)

    def refusal(reason: str) -> BadInput:
        return BadInput("learning.start_from", folder, reason)

    try:
        manifest = manifests.read(folder)
    except BadRun as error:
        raise refusal(f"must be the folder of a run with record.weights=true ({error})") from None
    if WEIGHTS not in manifest["files"]:
        raise refusal("this run did not store its weights; run it with record.weights=true")
    apart = differences([_network(manifest["config"]), _network(to_plain(config))])[0]
    if apart:
        there = " ".join(f"{key}={value}" for key, value in apart.items())
        raise refusal(f"its weights were learnt with {there}; give the same here")
    try:
        with np.load(require_intact(folder / WEIGHTS), allow_pickle=False) as arrays:
            return dict(arrays)
    except BadRun as error:
        raise refusal(f"must hold the weights that its run wrote ({error})") from None
    except (OSError, ValueError, BadZipFile) as error:
        raise refusal(f"{WEIGHTS} cannot be read ({error}); run it again") from None


def start_hash(config: Config) -> str | None:
    """SHA-256 of the weights that a run starts from; None if from nothing, or if they are gone."""
    if config.learning.start_from is None:
        return None
    path = Path(config.learning.start_from) / WEIGHTS
    return current_hash(path) if path.is_file() else None
