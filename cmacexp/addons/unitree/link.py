"""The link to a robot: it sends commands and receives states, and checks both against limits."""

import gc
import time
from collections import deque
from typing import Any

import numpy as np

from cmacexp.addons.unitree.guardian import Guardian, make_damping
from cmacexp.addons.unitree.log import Log
from cmacexp.addons.unitree.messages import Message, is_damping, new_command, set_motors
from cmacexp.addons.unitree.network import COMMANDS, Wire, run_first
from cmacexp.addons.unitree.states import LimitsConfig, Reading, StateWatch, Unsafe, read_state
from cmacexp.errors import BadInput, CmacexpError, require
from cmacexp.typing import Array

ANSWERS = 12.0
"""Longest time until the first states of a robot have arrived, s."""
FIRST_STATES = 100
"""Number of states from which the increment of their counter is measured."""
OTHERS = 0.3
"""Time for which no other sender may send commands that move the robot, s."""
RATES = (0.6, 1.6)
"""Bounds of the measured period of the states over the sampling period."""
TAKES_OVER = 0.1
"""Time for which a robot is damped before it moves; the guardian of an earlier run must fall silent within it, s."""
LASTS = 1.0
"""Time for which the controller damps a robot at the end of a run, s, before it leaves it to the guardian."""
RAMP = 0.5
"""Time in which the gains of a motion rise or fall to their values, s."""
REPEATED = 4
"""Sampling periods for which a state with the numbers of the last one is ignored: a simulator that is slower than its
clock sends each state several times."""
REMEMBERED = 100
"""Number of commands after which nobody may repeat one of them."""
JUMP = 2.0
"""Largest difference of a commanded from a measured angle, over the limit ``deviation``."""

Gains = tuple[float, float]
"""Stiffness, N m/rad, and damping, N m s/rad, of all joints."""


class Link:
    """The connection to a robot with four legs of three joints: sends commands, receives states.

    Attributes:
        signals: the last state.
        arrived: time at which it arrived, s on the clock of ``time.perf_counter``.
        commanded: angles (4, 3) of the last command, rad.
        watch: monitor that compares states with the limits.
        guardian: the guardian of a robot that is about to move.
        log: where states and commands are written; None: nowhere.
    """

    guardian: Guardian
    log: Log | None = None
    arrived = 0.0

    def __init__(self, interface: str, domain: int, period: float, limits: LimitsConfig):
        """Receive the first states of a robot; nothing is sent yet.

        ``period`` is the sampling period, s. Raises BadInput if no robot answers, if another sender commands it, or
        if it is not fit to stand up.
        """
        self.interface = interface
        self.domain = domain
        self.period = period
        self.limits = limits
        self.command = new_command()
        self._sent = deque[Any](maxlen=REMEMBERED)
        """Angles of the last commands, with which the guardian may have held the robot."""
        self._alone_from = 0.0
        """Time from which on nobody else may damp the robot either, s."""
        run_first(True)  # the threads of DDS inherit the priority
        try:
            self.wire = Wire(interface, domain, COMMANDS)
        finally:
            run_first(False)
        reading, tick = self._listen()
        self._require_alone()
        self.first = reading
        self.signals = reading.signals
        self.commanded = self.signals.q
        self.gains: Gains = (0.0, 0.0)
        self.watch = StateWatch(limits, self.commanded.shape, tick)
        try:
            self.watch.check(reading, self.commanded)
        except Unsafe as error:
            raise BadInput("plant.interface", interface, f"the robot is not fit to stand up: {error}") from error

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

    def _require_alone(self) -> None:
        """Require that nobody else has sent commands for OTHERS seconds, except for damping; raise BadInput."""
        end = time.monotonic() + OTHERS
        while time.monotonic() < end:
            other = self.wire.receive_other()
            require(
                other is None or is_damping(other),
                "plant.domain",
                self.domain,
                "somebody else sends commands to this robot: release its sport mode, or wait for the run before",
            )
            time.sleep(self.period)

    def begin(self, damping: float) -> None:
        """Damp the robot for a moment, then start with the newest state; raise Unsafe.

        From now on this thread runs with real-time priority. ``damping`` is in N m s/rad.
        """
        run_first(True)
        gc.disable()  # a collection takes longer than a step
        self.damp(damping, TAKES_OVER)
        self._alone_from = time.perf_counter() + TAKES_OVER
        self.watch = StateWatch(self.limits, self.commanded.shape, self.watch.tick)
        self.wire.receive(self.limits.silence)  # discards an older state
        self.arrived = time.perf_counter()
        self.receive(starts=True)
        self.commanded = self.signals.q
        self.gains = (0.0, damping)

    def send(self, angle: Any, velocity: Any, torque: Any, stiffness: Any, damping: Any) -> None:
        """Send a command to the drives; all arguments are (4, 3), or one number for all joints.

        These are angle, rad, velocity, rad/s, feedforward torque, N m, and gains, N m/rad and N m s/rad. The torque,
        and its sum with the feedback of the drive at the last state, are limited; where the torque alone cannot keep
        the sum within the limit, the angle is moved. Raises Unsafe if a number is not finite, a gain too large, or an
        angle too far from the measured one; CmacexpError if the guardian has taken over.
        """
        signals = self.signals
        limits = self.limits
        off = np.abs(angle - signals.q)
        is_finite = all(np.isfinite(values).all() for values in (angle, velocity, torque, stiffness, damping))
        Unsafe.unless(is_finite, "a command is not finite")
        for name, value, limit in (
            ("stiffness", np.max(stiffness), limits.stiffness),
            ("damping", np.max(damping), limits.damping),
        ):
            Unsafe.unless(value <= limit, "a {} of {:.3g} is above plant.limits.{}={:g}", name, value, name, limit)
        Unsafe.unless(
            off.max() <= JUMP * limits.deviation,
            "a command is {:.2g} rad from where its joint is, beyond {:g} times plant.limits.deviation={:g}",
            off.max(),
            JUMP,
            limits.deviation,
        )
        feedback = stiffness * (angle - signals.q) + damping * (velocity - signals.dq)
        total = np.clip(torque + feedback, -limits.torque, limits.torque)
        torque = np.clip(total - feedback, -limits.torque, limits.torque)
        excess = torque + feedback - total
        moved = angle - np.divide(excess, stiffness, out=np.zeros_like(excess), where=np.asarray(stiffness) > 0.0)
        set_motors(self.command, q=moved, dq=velocity, tau=torque, kp=stiffness, kd=damping)
        self._transmit(self.command)
        self.commanded = angle
        if self.log is not None:
            self.log.add(*signals[:3], moved, velocity, torque, stiffness, damping)

    def _transmit(self, command: Message) -> None:
        """Send a command, and report it to the guardian; raise CmacexpError if that has taken over."""
        self.guardian.report(command)
        self.wire.send(command)
        self._sent.append(command["motor_cmd"]["q"].copy())

    def receive(self, starts: bool = False) -> None:
        """Wait for the next state; raise Unsafe if none arrives, if it exceeds a limit, or if others send commands.

        A state with an angle that leaps, or with the numbers of the last, counts as none. Meanwhile the guardian
        holds the robot. A robot that ``starts`` may be far from the last command.
        """
        begun = time.perf_counter()
        trouble = f"no state for {1e3 * self.limits.silence:g} ms, plant.limits.silence"
        while (message := self.wire.receive(begun + self.limits.silence - time.perf_counter())) is not None:
            now = time.perf_counter()
            reading = read_state(message)
            is_new = now > begun + REPEATED * self.period or not self.watch.repeats(reading)
            leap = self.watch.find_leap(reading, now - self.arrived, self.period)
            if is_new and not leap:
                break
            trouble = leap or trouble
        else:
            raise Unsafe("{}", trouble)
        self.arrived = now
        self.signals = reading.signals
        self.watch.check(reading, self.signals.q if starts else self.commanded)
        self._check_alone()

    def _check_alone(self) -> None:
        """Raise Unsafe if another sender commands the robot; its guardian, which repeats angles, is none."""
        other = self.wire.receive_other()
        if other is None or (is_damping(other) and time.perf_counter() < self._alone_from):
            return
        repeats = any(np.array_equal(other["motor_cmd"]["q"], angles) for angles in self._sent)
        Unsafe.unless(repeats, "somebody else sends commands to this robot too")

    def move(self, goal: Array, duration: float, gains: Gains) -> None:
        """Move all joints at constant speed to ``goal`` (4, 3), rad, within ``duration``, s; raise Unsafe.

        The gains change from those of the last motion to ``gains`` within RAMP.
        """
        start = self.commanded
        before = np.array(self.gains)
        steps = max(1, round(duration / self.period))
        for step in range(1, steps + 1):
            share = step / steps
            risen = min(1.0, step * self.period / min(RAMP, duration))
            self.gains = tuple((before + risen * (np.array(gains) - before)).tolist())
            self.send((1.0 - share) * start + share * goal, 0.0, 0.0, *self.gains)
            self.receive()

    def damp(self, damping: float, duration: float = LASTS) -> None:
        """Damp the robot with ``damping``, N m s/rad, for a ``duration``, s, unless its guardian has taken over."""
        command = make_damping(damping)
        end = time.monotonic() + duration
        while time.monotonic() < end:
            try:
                self._transmit(command)
            except CmacexpError:
                if self.guardian.runs:
                    return
                self.wire.send(command)  # the guardian was ended
            time.sleep(self.period)

    def end(self) -> None:
        """Leave the robot to the guardian; from now on this thread runs with normal priority."""
        gc.enable()
        run_first(False)
        self.guardian.release()
