"""How much memory a run will need, and whether the machine has it: checked before anything is planned."""

import os
from functools import reduce
from pathlib import Path

from cmacexp.config.cmac import CMACS
from cmacexp.config.component import ComponentConfig, find_option
from cmacexp.config.schema import Config
from cmacexp.errors import BadInput

PROGRAM = 320e6
"""Bytes of the program itself with its libraries."""
GROUPS = Path("/sys/fs/cgroup")
LIMITS = ("memory.max", "memory/memory.limit_in_bytes")
"""Files with the limit of a control group, of its second and first version."""


def available_memory() -> float:
    """Bytes that this process may use: the machine's memory, or less if a control group limits it."""
    try:
        found = [float(os.sysconf("SC_PHYS_PAGES")) * os.sysconf("SC_PAGE_SIZE")]
    except (AttributeError, OSError, ValueError):  # a system that does not say
        found = []
    for limit in LIMITS:
        try:
            found.append(float((GROUPS / limit).read_text()))
        except (OSError, ValueError):  # "max": none
            continue
    return min(found, default=float("inf"))


def estimate_memory(config: Config) -> dict[str, float]:
    """Bytes of the largest arrays of a run, from their shapes, by the key of the field that makes them large.

    Args:
        config: whose fields are checked.
    """
    steps, joints, cmac = config.steps_per_cycle, config.joints, config.cmac
    rows, learns = steps * config.legs, config.feedforward
    fields = learns if isinstance(learns, dict) else vars(learns)
    plan, samples = 6 * joints + 16, 8 * joints + 12  # columns
    cells = steps * cmac.layers if find_option("feedforward", fields["_target_"]) in CMACS else 0
    cell = 4 if cmac.receptive_field == "rectangular" and config.learning.rule == "paper" else 12  # row, activation
    copies = config.record.weights + 2 * (config.learning.start_from is not None)
    sizes: dict[str, float] = {
        "sampling_period": 8 * rows * (plan + 3 * samples),  # samples, the table of the trace, input of the metrics
        "cmac.layers": cells * (cell * config.legs + 8),  # of all legs, and the search for those of one
        "cmac.memory_bytes": config.legs * cmac.memory_bytes * copies if cells else 0,
    }
    if isinstance(learns, ComponentConfig):
        inputs, centres, hidden = (fields.get(name, 0) for name in ("inputs", "centres", "hidden"))
        distances = joints * len(inputs or ()) + 1  # differences along each input, and their norm
        sizes["feedforward.centres"] = 8 * centres * max(steps * distances, centres * 2 * distances)
        sizes["feedforward.hidden"] = 12 * steps * hidden  # activations and their copies of half the precision
    return sizes


def check_memory(config: Config) -> None:
    """Check that the machine has the memory that a run needs.

    Raises:
        BadInput: it has less; names the field that decides most of it, and the estimate.
    """
    sizes, available = estimate_memory(config), available_memory()
    needed = PROGRAM + sum(sizes.values())
    if needed <= available:
        return
    steps, key = config.steps_per_cycle, max(sizes, key=lambda name: sizes[name])
    value = reduce(getattr, key.split("."), config)
    need = f"needs about {needed / 1e9:.1f} GB with {steps} steps a cycle, but there are {available / 1e9:.1f} GB"
    advice = "take a larger one" if key == "sampling_period" else "take a smaller one, or a larger sampling_period"
    raise BadInput(key, value, f"{need}: {advice}")
