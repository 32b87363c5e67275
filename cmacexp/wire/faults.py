"""Faults that a simulated robot can have, to practise what happens then: one at a time, from some second on."""

from dataclasses import dataclass, field

import numpy as np

from cmacexp.errors import BadInput, suggest
from cmacexp.typing import Array
from cmacexp.wire.messages import Message, compute_checksum

NO_FAULT = "none"
KINDS = {
    NO_FAULT: "nothing is wrong",
    "lost_states": "5 % of its states are lost",
    "lost_commands": "5 % of the commands are lost, which its motors count",
    "late": "its states are held back for 20 ms, twice a second",
    "frozen": "it sends the same state again and again",
    "frozen_numbers": "likewise, but the tick goes on",
    "nan": "one joint angle is not a number",
    "stuck": "the encoder of one joint is stuck",
    "sign": "one joint turns the other way, encoder and motor",
    "sign_of_encoder": "the encoder of one joint counts the other way",
    "swapped": "the cables of two legs are swapped",
    "swapped_encoders": "only the cables of their encoders are",
    "hot": "one motor is at 90 degrees Celsius",
    "empty": "the battery is at 20 V",
}
"""What each does."""
PART = 0.05
BURST, EVERY = 10, 250
"""States that are held back, of so many."""
MEASURED = ("motor_state.q", "motor_state.dq", "motor_state.tau_est")
COMMANDED = ("motor_cmd.q", "motor_cmd.dq", "motor_cmd.tau")
GAINS = ("motor_cmd.kp", "motor_cmd.kd")


@dataclass
class Fault:
    """A fault of a simulated robot; raises BadInput of another kind than of KINDS."""

    kind: str = NO_FAULT
    start: int = 0
    """State from which on it is there, counted from the first command; 0: always."""
    motor: int = 0
    """That it is of, 0 to 11; the leg of this motor and the next leg are swapped."""
    seed: int = 0
    _frozen: Message | None = field(default=None, init=False)
    _lost: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise BadInput("--fault", self.kind, f"choose from {', '.join(KINDS)}{suggest(self.kind, KINDS)}")
        self._random = np.random.default_rng(self.seed)

    def loses_command(self, step: int) -> bool:
        """Whether a command is lost on its way to the motors."""
        lost = self.kind == "lost_commands" and step >= self.start and self._random.random() < PART
        self._lost += lost
        return lost

    def spoil_command(self, command: Message, step: int) -> Message:
        """A command as it reaches the motors."""
        if step >= self.start and self.kind in ("sign", "swapped"):
            for name in (*COMMANDED, *GAINS) if self.kind == "swapped" else COMMANDED:
                command[name] = self._disturb(command[name])
            command["crc"] = compute_checksum(command.body)
        return command

    def spoil_state(self, state: Message, step: int) -> Message | None:
        """A state as it is sent; None: it is not."""
        if step < self.start:
            return state
        is_held_back = self.kind == "late" and (step - self.start) % EVERY < BURST
        if is_held_back or (self.kind == "lost_states" and self._random.random() < PART):
            return None
        sent = Message("LowState_", state.tobytes())
        sent["motor_state.lost"] = self._lost
        if self.kind in ("sign", "sign_of_encoder", "swapped", "swapped_encoders"):
            for name in MEASURED if self.kind in ("sign", "swapped") else MEASURED[:2]:
                sent[name] = self._disturb(sent[name])
        self._frozen = self._frozen or Message("LowState_", sent.tobytes())
        return self._spoil_values(sent, self._frozen)

    def _disturb(self, values: Array) -> Array:
        """Numbers of 20 motors with the sign of one, or with two legs, exchanged."""
        if self.kind.startswith("sign"):
            values[self.motor] = -values[self.motor]
            return values
        legs = values[:12].reshape(4, 3)
        own, other = self.motor // 3, (self.motor // 3 + 1) % 4
        legs[[own, other]] = legs[[other, own]]
        return values

    def _spoil_values(self, sent: Message, frozen: Message) -> Message:
        if self.kind in ("frozen", "frozen_numbers"):
            frozen["tick"] = frozen["tick"] if self.kind == "frozen" else sent["tick"]
            return frozen
        motor: dict[str, dict[str, float]] = {
            "nan": {"motor_state.q": np.nan},
            "stuck": {"motor_state.q": float(frozen["motor_state.q"][self.motor]), "motor_state.dq": 0.0},
            "hot": {"motor_state.temperature": 90},
        }
        for name, value in motor.get(self.kind, {}).items():
            values = sent[name]
            values[self.motor] = value
            sent[name] = values
        if self.kind == "empty":
            sent["power_v"] = 20.0
        return sent
