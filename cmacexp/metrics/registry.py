"""All columns of ``metrics.parquet`` but ``cycle`` and ``leg``, in their order."""

from typing import Any

from cmacexp.metrics.block import Block
from cmacexp.metrics.force import FORCE
from cmacexp.metrics.learning import LEARNING
from cmacexp.metrics.memory import MEMORY
from cmacexp.metrics.metric import Metric
from cmacexp.metrics.torque import TORQUE
from cmacexp.metrics.tracking import TRACKING

OF_A_CYCLE: dict[str, Metric[Block]] = {**TRACKING, **FORCE, **TORQUE}
"""What a cycle tells alone."""
METRICS: dict[str, Metric[Any]] = {**OF_A_CYCLE, **LEARNING, **MEMORY}
"""All, by name."""
