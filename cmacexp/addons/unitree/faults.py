"""Faults of a simulated robot, one at a time: what it receives and sends from a given state on."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from cmacexp.addons.unitree.messages import Message, compute_checksum
from cmacexp.addons.unitree.states import STOP
from cmacexp.errors import require_name

NO_FAULT = "none"
KINDS = {
    NO_FAULT: "no fault",
    "lost_states": "5 % of the states are lost",
    "lost_commands": "5 % of the commands are lost, and counted by the motors",
    "late": "no states for 20 ms, twice a second",
    "stall": "the robot and its clock stand still for --lasts, once a second",
    "leap": "one joint is read 0.5 rad too large in ten states, once a second",
    "remote": "L2 and B of the remote control are pressed",
    "other": "the battery has 58 V, as that of a larger robot",
    "frozen": "the same state is sent in every step",
    "frozen_numbers": "the same state with a counting tick is sent in every step",
    "nan": "one joint angle is not a number",
    "stuck": "the encoder of one joint is stuck",
    "sign": "encoder and motor of one joint have the wrong sign",
    "sign_of_encoder": "the encoder of one joint has the wrong sign",
    "swapped": "the cables of two legs are swapped",
    "swapped_encoders": "the encoder cables of two legs are swapped",
    "hot": "one motor is at 90 degrees Celsius",
    "empty": "the battery is at 20 V",
}
"""Faults of a simulated robot, with their effect."""
LOST = 0.05
"""Probability that a message is lost under the faults ``lost_states`` and ``lost_commands``."""
BURST, EVERY = 10, 250
"""Under the faults ``late`` and ``leap``, number of bad states out of this number, for ``leap`` of twice that."""
LEAP = 0.5
"""Error of an angle under the fault ``leap``, rad."""
MEASURED = ("q", "dq", "tau_est")
"""Fields of a motor in a state."""
COMMANDED = ("q", "dq", "tau")
"""Fields of a motor in a command, without its gains."""


@dataclass
class Fault:
    """A fault of a simulated robot; raises BadInput if its kind is not one of KINDS."""

    kind: str = NO_FAULT
    start: int = 0
    """First state with the fault, counted from the first command; 0: the fault is always present."""
    motor: int = 0
    """Faulty motor, 0 to 11; faults of two legs affect the leg of this motor and the next leg."""
    lasts: float = 0.1
    """Duration of a stall, s."""
    _first: Message | None = field(default=None, init=False)
    """State at the beginning of the fault."""
    _lost: int = field(default=0, init=False)
    """Number of lost commands."""

    def __post_init__(self) -> None:
        require_name("--fault", self.kind, KINDS)
        self._random = np.random.default_rng(0)

    def spoil_command(self, command: Message, step: int) -> Message | None:
        """Return the command as the motors receive it in a ``step``, or None if it is lost."""
        if step < self.start:
            return command
        if self.kind == "lost_commands" and self._random.random() < LOST:
            self._lost += 1
            return None
        if self.kind in ("sign", "swapped"):
            self._disturb(command["motor_cmd"], COMMANDED if self.kind == "sign" else (*COMMANDED, "kp", "kd"))
            command["crc"] = compute_checksum(command)
        return command

    def spoil_state(self, state: Message, step: int) -> Message | None:
        """Return the state as it is sent in a ``step``, or None if it is not sent."""
        if step < self.start:
            return state
        is_held_back = self.kind == "late" and (step - self.start) % EVERY < BURST
        if is_held_back or (self.kind == "lost_states" and self._random.random() < LOST):
            return None
        first = self._first = state.copy() if self._first is None else self._first
        sent = (first if self.kind.startswith("frozen") else state).copy()
        motors = sent["motor_state"]
        motors["lost"] = self._lost
        self._spoil_robot(sent)
        match self.kind:
            case "frozen_numbers":
                sent["tick"] = state["tick"]
            case "sign" | "swapped":
                self._disturb(motors, MEASURED)
            case "sign_of_encoder" | "swapped_encoders":
                self._disturb(motors, ("q", "dq"))
            case "nan":
                motors["q"][self.motor] = np.nan
            case "stuck":
                motors["q"][self.motor] = first["motor_state"]["q"][self.motor]
                motors["dq"][self.motor] = 0.0
            case "leap" if (step - self.start) % (2 * EVERY) < BURST:
                motors["q"][self.motor] += LEAP
        return sent

    def _spoil_robot(self, state: Message) -> None:
        """Write what belongs to no joint."""
        match self.kind:
            case "hot":
                state["motor_state"]["temperature"][self.motor] = 90
            case "empty" | "other":
                state["power_v"] = 20.0 if self.kind == "empty" else 58.0
            case "remote":
                for byte, bit in STOP:
                    state["wireless_remote"][byte] = bit

    def stall(self, step: int) -> float:
        """Return for how long the robot and its clock stand still before a ``step``, s."""
        is_due = self.kind == "stall" and step >= self.start and (step - self.start) % (2 * EVERY) == 0
        return self.lasts if is_due else 0.0

    def _disturb(self, motors: Message, names: Sequence[str]) -> None:
        """Invert the sign of these fields of the faulty motor, or exchange them between two legs."""
        leg = self.motor // 3
        following = (leg + 1) % 4
        for name in names:
            legs = motors[name][:12].reshape(4, 3)
            if self.kind.startswith("sign"):
                motors[name][self.motor] *= -1.0
            else:
                legs[[leg, following]] = legs[[following, leg]]
