"""How much memory a run will need, and whether the machine has it: checked before anything is planned."""

import os
from pathlib import Path

from cmacexp.config.component import COMPONENTS, ComponentConfig, MemoryNeed
from cmacexp.config.schema import Config
from cmacexp.errors import BadInput

PROGRAM = 320e6
"""Bytes of the program itself, its libraries and compiling included."""
PLAN = {2: 245, 3: 520}
"""Bytes per sample and leg of a cycle that its plan needs, by the number of joints of a leg."""
LOOP = {2: 530, 3: 940}
"""Bytes per sample and leg that a cycle of samples, its trace and its metrics need beside the plan, likewise."""
CAUSE = 10.0
"""A component that needs so many times what plan and loop do is too large; else there are too many samples."""
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


def estimate_memory(config: Config) -> tuple[float, MemoryNeed]:
    """Bytes that a run needs at most, and the component that needs most of them.

    A component needs its memory when it is reset, before the loop begins.

    Args:
        config: whose fields are checked.
    """
    rows = config.steps_per_cycle * config.legs
    components = (getattr(config, group) for group in COMPONENTS)
    needs = [each.memory_need(config) for each in components if isinstance(each, ComponentConfig)]
    largest = max(needs, key=lambda need: need.bytes, default=MemoryNeed())
    return PROGRAM + rows * PLAN[config.joints] + max(rows * LOOP[config.joints], largest.bytes), largest


def check_memory(config: Config) -> None:
    """Check that the machine has the memory that a run needs.

    Raises:
        BadInput: it has less; names the key to change, and the estimate.
    """
    needed, component = estimate_memory(config)
    available = available_memory()
    if needed <= available:
        return
    steps, plan, loop = config.steps_per_cycle, PLAN[config.joints], LOOP[config.joints]
    need = f"needs about {needed / 1e9:.1f} GB with {steps} steps a cycle, but there are {available / 1e9:.1f} GB"
    if component.bytes > CAUSE * (plan + loop) * steps * config.legs:
        raise BadInput(component.key, component.value, f"{need}: take a smaller one, or a larger sampling_period")
    also = f", or a smaller {component.key}" if component.bytes > loop * steps * config.legs else ""
    raise BadInput("sampling_period", config.sampling_period, f"{need}: take a larger one{also}")
