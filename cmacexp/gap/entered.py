"""A method of a user that takes a log: a class without arguments, with ``fit(strokes)`` and ``predict(stroke)``."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from cmacexp.gap.signals import Signals, differentiate
from cmacexp.typing import Array


@dataclass(frozen=True)
class Stroke:
    """A stroke of a log, (rows, J) each; what was measured is None until it is over."""

    period: float
    """Of the rows, s."""
    phase: Array
    """(rows,) from 0 to 1."""
    command: Array
    """Angles that the drives were given, rad."""
    command_rate: Array
    """Their derivative, rad/s."""
    angle: Array | None = None
    """Measured, rad."""
    torque: Array | None = None
    """Of the drives, N m: what the method predicts."""


@dataclass
class Entered:
    """A method of a user as a learner; it is given copies, and of the next stroke nothing that was measured.

    ``method.fit(strokes)`` is called after every stroke with all so far; ``method.predict(stroke)`` returns the
    torque (rows, J) of the next one, N m.
    """

    signals: Signals
    method: Any
    strokes: list[Stroke] = field(default_factory=list)

    @cached_property
    def _rate(self) -> Array:
        """Of all commands, rad/s."""
        return differentiate(self.signals.command, self.signals.log.period)

    def _cut(self, rows: slice) -> Stroke:
        own = self.signals
        return Stroke(own.log.period, own.phase[rows].copy(), own.command[rows].copy(), self._rate[rows].copy())

    def predict(self, rows: slice) -> Array:
        """What the method says; raises ValueError unless it is finite numbers of the right shape."""
        found = np.asarray(self.method.predict(self._cut(rows)), dtype=float)
        if found.shape != (shape := self.signals.torque[rows].shape) or not np.isfinite(found).all():
            stroke = f"stroke {self.signals.stroke[rows.start]} has shape {found.shape} or is not finite"
            raise ValueError(f"the torque of {stroke}: must be finite numbers of shape {shape}")
        return found

    def learn(self, rows: slice, torque: Array) -> None:
        """Let it fit to one more stroke."""
        angle = self.signals.log.angle[rows].copy()
        self.strokes.append(replace(self._cut(rows), angle=angle, torque=torque.copy()))
        self.method.fit(list(self.strokes))
