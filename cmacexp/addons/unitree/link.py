"""The link to a robot: commands out, states in, each compared with the limits, a guardian beside, and a log."""

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
"""Longest time until a robot is heard at all, s."""
FIRST_STATES = 100
"""States from which the step of their counter follows."""
OTHERS = 0.3
"""Time for which the wire must be free of commands of others, s."""
RATES = (0.6, 1.6)
"""Bounds of the measured time from one state to the next over the sampling period."""
LASTS = 1.0
"""Time for which a robot is damped at the end, s."""
JUMP = 2.0
"""Largest difference of a commanded angle from the measured one, over that which may last."""
LOGGED = ("q", "dq", "tau", "q_des", "dq_des", "tau_ff", "kp", "kd")
"""Columns of a log, each before the name of a joint, as :mod:`cmacexp.gap` reads them: rad, rad/s, N m, and the gains
in N m/rad and N m s/rad."""

Gains = tuple[float, float]
"""Stiffness, N m/rad, and damping, N m s/rad, of all joints."""


class Link:
    """Commands to a robot of four legs with three joints each, and its states.

    Attributes:
        signals: the last state.
        arrived: when it came, s on the clock of ``time.perf_counter``.
        asked: commanded angles (4, 3) of the last command, rad.
        watch: what compares states with the limits.
    """

    def __init__(self, interface: str, domain: int, period: float, limits: LimitsConfig, log: bool):
        """Hear a robot; nothing is sent yet. ``period`` in s. Raises BadInput if there is none, or if it is unfit."""
        self.interface, self.period, self.limits = interface, period, limits
        self.command = new_command()
        run_first(True)  # for the threads of the wire
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
        self.asked = self.signals.q
        self.watch = StateWatch(limits, self.asked.shape, tick)
        self.rows: list[Array] | None = [] if log else None
        try:
            self.watch.check(reading, self.asked)
        except Unsafe as error:
            raise BadInput("plant.interface", interface, f"the robot is not fit to stand up: {error}") from error
        self.guardian: Guardian | None = None
        """The guardian of a robot that is about to move."""

    def _listen(self) -> tuple[Reading, int]:
        """The newest of the first states, and by how much their counter grows; raises BadInput without any."""
        heard: list[tuple[float, Reading]] = []
        end = time.monotonic() + ANSWERS
        while len(heard) < FIRST_STATES and time.monotonic() < end:
            if (message := self.wire.receive(0.1)) is not None:
                heard.append((time.perf_counter(), read_state(message)))
        require(
            len(heard) == FIRST_STATES,
            "plant.interface",
            self.interface,
            f"{len(heard)} states within {ANSWERS:g} s: connect the robot, or start cmacexp robot --simulate",
        )
        times, steps = np.diff([(at, reading.signals.tick[0]) for at, reading in heard], axis=0).T
        tick = max(1, int(np.median(steps)))
        period = float(np.median(times * tick / np.maximum(steps, 1)))
        fits = RATES[0] * self.period < period < RATES[1] * self.period
        require(
            fits, "sampling_period", self.period, f"the robot's states come every {1e3 * period:.2g} ms: use that"
        )
        return heard[-1][1], tick

    def begin(self) -> None:
        """Take the newest state as the first; from now on this thread runs before others. Raises Unsafe."""
        run_first(True)
        gc.disable()  # it takes longer than a step
        self.watch = StateWatch(self.limits, self.asked.shape, self.watch.tick)
        self.wire.receive(self.limits.silence)  # what came meanwhile is old
        self.receive()
        self.asked = self.signals.q

    def send(self, angle: Any, velocity: Any, torque: Any, stiffness: Any, damping: Any) -> None:
        """Send a command: (4, 3) each, or one number; with less torque where that and the drive would give too much.

        Raises Unsafe if it is not finite, or too far from where the joints are; CmacexpError if the guardian has
        taken over.
        """
        signals, most = self.signals, self.limits.torque
        off = np.abs(angle - signals.q)
        Unsafe.unless(all(np.isfinite(each).all() for each in (angle, velocity, torque)), "a command is not finite")
        Unsafe.unless(
            off.max() <= JUMP * self.limits.deviation,
            "a command is {:.2g} rad from where its joint is, beyond {:g} times plant.limits.deviation={:g}",
            off.max(),
            JUMP,
            self.limits.deviation,
        )
        law = stiffness * (angle - signals.q) + damping * (velocity - signals.dq)
        torque = np.clip(torque + law, -most, most) - law
        set_motors(self.command, q=angle, dq=velocity, tau=torque, kp=stiffness, kd=damping)
        if self.guardian is not None:
            self.guardian.report()
        self.wire.send(self.command)
        self.asked = angle
        if self.rows is not None:
            sent = (np.broadcast_to(each, angle.shape) for each in (angle, velocity, torque, stiffness, damping))
            self.rows.append(np.stack([*signals[:3], *sent]))

    def receive(self) -> None:
        """Wait for the next state; raises Unsafe if none comes, or if it is beyond a limit."""
        message = self.wire.receive(self.limits.silence)
        self.arrived = time.perf_counter()
        if message is None:
            raise Unsafe(f"no state for {1e3 * self.limits.silence:g} ms, plant.limits.silence")
        reading = read_state(message)
        self.signals = reading.signals
        self.watch.check(reading, self.asked)

    def move(self, goal: Array, duration: float, gains: Gains) -> None:
        """Move all joints evenly to ``goal`` (4, 3), rad, within ``duration``, s; raises Unsafe."""
        start, steps = self.asked, max(1, round(duration / self.period))
        for step in range(steps):
            share = (step + 1) / steps
            self.send((1.0 - share) * start + share * goal, 0.0, 0.0, *gains)
            self.receive()

    def damp(self, damping: float) -> None:
        """Damp the robot for a while, whatever has happened."""
        command = make_damping(damping)
        for _ in range(round(LASTS / self.period)):
            if self.guardian is not None:
                with suppress(CmacexpError):  # it damps too
                    self.guardian.report()
            self.wire.send(command)
            time.sleep(self.period)

    def end(self) -> None:
        """End the guardian; from now on this thread runs as others do."""
        gc.enable()
        run_first(False)
        if self.guardian is not None:
            self.guardian.end()
            self.guardian = None

    def write_log(self, path: Path, joints: Sequence[str]) -> None:
        """Write what was measured and sent so far, with columns by the names of 12 ``joints``."""
        rows = np.stack(self.rows or [np.zeros((len(LOGGED), *self.asked.shape))])
        names = [f"{name}_{joint}" for name in LOGGED for joint in joints]
        columns = dict(zip(names, rows.reshape(len(rows), -1).T, strict=True))
        write_table(pa.table({"time": self.period * np.arange(len(rows)), **columns}), path)
