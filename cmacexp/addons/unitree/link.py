"""The link to a robot: it sends commands and receives states, checks both against limits, and logs them."""

import gc
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from cmacexp.addons.unitree.guardian import Guardian, make_damping
from cmacexp.addons.unitree.messages import new_command, set_motors
from cmacexp.addons.unitree.network import COMMANDS, STATES, Wire, run_first
from cmacexp.addons.unitree.states import LimitsConfig, Reading, StateWatch, Unsafe, read_state
from cmacexp.data.tables import write_table
from cmacexp.errors import BadInput, CmacexpError, require
from cmacexp.typing import Array

ANSWERS = 5.0
"""Longest time until the first states of a robot have arrived, s."""
FIRST_STATES = 100
"""Number of states from which the increment of their counter is measured."""
OTHERS = 0.3
"""Time for which no other sender may send commands, s."""
RATES = (0.6, 1.6)
"""Bounds of the measured period of the states over the sampling period."""
LASTS = 1.0
"""Time for which a robot is damped at the end of a run, s."""
JUMP = 2.0
"""Largest difference of a commanded from a measured angle, over the limit ``deviation``."""
LOGGED = ("q", "dq", "tau", "q_des", "dq_des", "tau_ff", "kp", "kd")
"""Prefixes of the columns of a log, before the name of a joint: rad, rad/s, N m, N m/rad and N m s/rad.

:mod:`cmacexp.addons.gap` reads them.
"""

Gains = tuple[float, float]
"""Stiffness, N m/rad, and damping, N m s/rad, of all joints."""


class Link:
    """The connection to a robot with four legs of three joints: sends commands, receives states.

    Attributes:
        signals: the last state.
        arrived: time at which it arrived, s on the clock of ``time.perf_counter``.
        commanded: angles (4, 3) of the last command, rad.
        watch: monitor that compares states with the limits.
    """

    def __init__(self, interface: str, domain: int, period: float, limits: LimitsConfig, log: bool):
        """Receive the first states of a robot; nothing is sent yet.

        ``period`` is the sampling period, s. With ``log`` all commands and states are kept. Raises BadInput if no
        robot answers, if another sender commands it, or if it is not fit to stand up.
        """
        self.interface = interface
        self.period = period
        self.limits = limits
        self.command = new_command()
        run_first(True)  # the threads of DDS inherit the priority
        try:
            require(
                Wire(interface, domain, None, COMMANDS).receive(OTHERS) is None,
                "plant.domain",
                domain,
                "somebody else sends commands to this robot: release its sport mode, or wait for the run before",
            )
            self.wire = Wire(interface, domain, COMMANDS, STATES)
        finally:
            run_first(False)
        reading, tick = self._listen()
        self.signals = reading.signals
        self.commanded = self.signals.q
        self.watch = StateWatch(limits, self.commanded.shape, tick)
        self.rows: list[Array] | None = [] if log else None
        try:
            self.watch.check(reading, self.commanded)
        except Unsafe as error:
            raise BadInput("plant.interface", interface, f"the robot is not fit to stand up: {error}") from error
        self.guardian: Guardian | None = None
        """The guardian of a robot that is about to move."""

    def _listen(self) -> tuple[Reading, int]:
        """Return the newest of the first states, and the increment of their counter; raise BadInput without them."""
        received: list[tuple[float, Reading]] = []
        end = time.monotonic() + ANSWERS
        while len(received) < FIRST_STATES and time.monotonic() < end:
            if (message := self.wire.receive(0.1)) is not None:
                received.append((time.perf_counter(), read_state(message)))
        require(
            len(received) == FIRST_STATES,
            "plant.interface",
            self.interface,
            f"{len(received)} states within {ANSWERS:g} s: connect the robot, or start cmacexp robot --simulate",
        )
        times, steps = np.diff([(at, reading.signals.tick[0]) for at, reading in received], axis=0).T
        tick = max(1, int(np.median(steps)))
        period = float(np.median(times * tick / np.maximum(steps, 1)))
        fits = RATES[0] * self.period < period < RATES[1] * self.period
        require(
            fits, "sampling_period", self.period, f"the robot's states come every {1e3 * period:.2g} ms: use that"
        )
        return received[-1][1], tick

    def begin(self) -> None:
        """Start with the newest state; from now on this thread runs with real-time priority. Raise Unsafe."""
        run_first(True)
        gc.disable()  # a collection takes longer than a step
        self.watch = StateWatch(self.limits, self.commanded.shape, self.watch.tick)
        self.wire.receive(self.limits.silence)  # discards an older state
        self.receive()
        self.commanded = self.signals.q

    def send(self, angle: Any, velocity: Any, torque: Any, stiffness: Any, damping: Any) -> None:
        """Send a command to the drives; all arguments are (4, 3), or one number for all joints.

        These are angle, rad, velocity, rad/s, feedforward torque, N m, and gains, N m/rad and N m s/rad. The torque
        is limited so that its sum with the feedback of the drive at the last state stays within the limit. Raises
        Unsafe if a number is not finite, or an angle too far from the measured one; CmacexpError if the guardian has
        taken over.
        """
        signals = self.signals
        off = np.abs(angle - signals.q)
        is_finite = all(np.isfinite(values).all() for values in (angle, velocity, torque))
        Unsafe.unless(is_finite, "a command is not finite")
        Unsafe.unless(
            off.max() <= JUMP * self.limits.deviation,
            "a command is {:.2g} rad from where its joint is, beyond {:g} times plant.limits.deviation={:g}",
            off.max(),
            JUMP,
            self.limits.deviation,
        )
        feedback = stiffness * (angle - signals.q) + damping * (velocity - signals.dq)
        torque = np.clip(torque + feedback, -self.limits.torque, self.limits.torque) - feedback
        set_motors(self.command, q=angle, dq=velocity, tau=torque, kp=stiffness, kd=damping)
        if self.guardian is not None:
            self.guardian.report()
        self.wire.send(self.command)
        self.commanded = angle
        if self.rows is not None:
            sent = np.broadcast_arrays(angle, velocity, torque, stiffness, damping)
            self.rows.append(np.stack([*signals[:3], *sent]))

    def receive(self) -> None:
        """Wait for the next state; raise Unsafe if none arrives, or if it exceeds a limit."""
        message = self.wire.receive(self.limits.silence)
        self.arrived = time.perf_counter()
        if message is None:
            raise Unsafe(f"no state for {1e3 * self.limits.silence:g} ms, plant.limits.silence")
        reading = read_state(message)
        self.signals = reading.signals
        self.watch.check(reading, self.commanded)

    def move(self, goal: Array, duration: float, gains: Gains) -> None:
        """Move all joints at constant speed to ``goal`` (4, 3), rad, within ``duration``, s; raise Unsafe."""
        start = self.commanded
        steps = max(1, round(duration / self.period))
        for step in range(steps):
            share = (step + 1) / steps
            self.send((1.0 - share) * start + share * goal, 0.0, 0.0, *gains)
            self.receive()

    def damp(self, damping: float) -> None:
        """Damp the robot with ``damping``, N m s/rad, for LASTS seconds, even if the guardian has taken over."""
        command = make_damping(damping)
        for _ in range(round(LASTS / self.period)):
            if self.guardian is not None:
                with suppress(CmacexpError):  # it has taken over, and damps too
                    self.guardian.report()
            self.wire.send(command)
            time.sleep(self.period)

    def end(self) -> None:
        """End the guardian; from now on this thread runs with normal priority."""
        gc.enable()
        run_first(False)
        if self.guardian is not None:
            self.guardian.end()
            self.guardian = None

    def write_log(self, path: Path, joints: Sequence[str]) -> None:
        """Write all states and commands to a Parquet file, with the names of the 12 ``joints`` in its columns."""
        rows = np.stack(self.rows or [np.zeros((len(LOGGED), *self.commanded.shape))])
        names = [f"{name}_{joint}" for name in LOGGED for joint in joints]
        columns = dict(zip(names, rows.reshape(len(rows), -1).T, strict=True))
        write_table(pa.table({"time": self.period * np.arange(len(rows)), **columns}), path)
