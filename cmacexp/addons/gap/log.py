"""A log of a robot: what was measured and commanded, joint by joint."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from cmacexp.addons.gap.names import JOINT
from cmacexp.errors import require, suggest
from cmacexp.typing import Array, Counts

KEY = "LOG"
"""Name of the file in error messages: the argument of the command."""


@dataclass(frozen=True)
class Log:
    """Measured and commanded signals of J joints at n instants (rows), arrays (n, J)."""

    path: Path
    time: Array
    """(n,), starting at 0, s."""
    joints: tuple[str, ...]
    """Names of the joints in the log."""
    angle: Array
    """Measured angle, rad."""
    command: Array | None
    """Commanded angle, rad; None: the log has torques only."""
    command_velocity: Array
    """Commanded velocity, rad/s; zero if the log has none."""
    torque: Array | None
    """Measured or applied torque, N m; None: the log has none."""
    feedforward: Array
    """Torque that the drives added to their feedback, N m; zero if the log has none."""
    kp: Array
    """(J,) stiffness gains of the drives, N m/rad; NaN: unknown."""
    kd: Array
    """(J,) damping gains of the drives, N m s/rad; NaN: unknown."""
    orientation: Array | None
    """(n, 4) orientation of the base in the world, a quaternion w, x, y, z; None: the base was held level."""
    velocity: Array | None = None
    """Measured velocity, rad/s, by which angles and times are checked; None: the log has none."""
    rows: Counts = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    """(n,) rows of the file, or the nearest ones; empty: the same."""
    names: Mapping[str, str] = field(default_factory=dict)
    """Name of the column of each quantity, with ``{joint}`` for the name of a joint."""
    is_unit_known: bool = True
    """False if torques are in a unit that does not say how many N m they are, such as currents."""
    unit_error: Array | None = None
    """(J,) relative standard error of N m for each unit of torque, where that was estimated; None: it is known."""
    notes: tuple[str, ...] = ()
    """What was changed or assumed when the log was read, one sentence each."""

    def note(self, sentence: str) -> "Log":
        """Return the log with one more note."""
        return replace(self, notes=(*self.notes, sentence))

    @property
    def period(self) -> float:
        """Median spacing of the rows, s."""
        return float(np.median(np.diff(self.time)))

    @property
    def has_gains(self) -> bool:
        """True if the gains of all drives are known."""
        return bool(np.isfinite(self.kp).all() and np.isfinite(self.kd).all())

    @property
    def has_drives(self) -> bool:
        """True if commands and gains are known, so that commands can be replayed."""
        return self.command is not None and self.has_gains

    def column(self, quantity: str, joint: int) -> str:
        """Return the name of the column of a ``quantity`` of the joint with this number."""
        return self.names.get(quantity, quantity).replace(JOINT, self.joints[joint])

    def lean(self, roll: float, pitch: float) -> "Log":
        """Return the log of a base that leans by two angles, rad: about x, then about the y axis of the world."""
        about_x, about_y = (np.array([np.cos(0.5 * angle), np.sin(0.5 * angle)]) for angle in (roll, pitch))
        turn = np.array(
            [about_x[0] * about_y[0], about_x[1] * about_y[0], about_x[0] * about_y[1], -about_x[1] * about_y[1]]
        )
        return replace(self, orientation=np.tile(turn, (len(self.time), 1)))

    def find_row(self, row: int) -> int:
        """Return the row of the file of a row of this log."""
        return int(self.rows[row]) if self.rows.size else row

    def leave_out(self, joints: Sequence[str]) -> "Log":
        """Return the log without some ``joints``; raise BadInput if it lacks one of them, or if none remains."""
        for name in joints:
            require(name in self.joints, "--leave-out", name, f"is no joint of the log{suggest(name, self.joints)}")
        kept = [j for j, name in enumerate(self.joints) if name not in joints]
        require(kept, "--leave-out", ",".join(joints), "leaves no joint of the log: keep at least one")
        signals = ("angle", "velocity", "command", "command_velocity", "torque", "feedforward")
        cut: dict[str, Any] = {
            key: None if (values := vars(self)[key]) is None else values[:, kept] for key in signals
        }
        return replace(self, joints=tuple(self.joints[j] for j in kept), kp=self.kp[kept], kd=self.kd[kept], **cut)
