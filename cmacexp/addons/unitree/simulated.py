"""A process that plays a robot at the other end of the wire: MuJoCo in real time, LowState out, LowCmd in.

It is the robot of ``plant=mujoco_robot_rigid`` with drives as of :mod:`cmacexp.plants.drives`: lag, late commands and
what it differs in from its model are those of its config. It hangs at first, as a robot should, and is let down once
its commands have rested; or it lies on the ground. Without commands its motors go on with the last one. To practise
what happens then it can have one fault at a time, from some second on.
"""

import gc
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from cmacexp.addons.unitree.messages import (
    HEADER,
    JOINTS,
    LEVEL_LOW,
    LOW_STATE,
    Message,
    compute_checksum,
    get_motors,
)
from cmacexp.addons.unitree.network import COMMANDS, STATES, Wire, run_first
from cmacexp.config.component import find_option
from cmacexp.config.machine import read_model
from cmacexp.config.schema import Config, read_component
from cmacexp.errors import require, require_name
from cmacexp.jit.compiler import program
from cmacexp.jit.interrupt import interrupt_held_back
from cmacexp.loop.scenario import make_scenario
from cmacexp.plants.drives import ANGLE, DAMPING, STIFFNESS, TORQUE, VELOCITY, new_drives, send_command
from cmacexp.plants.mujoco_kernels import advance_engine
from cmacexp.plants.mujoco_robot import MujocoRobot
from cmacexp.sensors.proprioceptive import ProprioceptiveConfig

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
MEASURED, COMMANDED, GAINS = ("q", "dq", "tau_est"), ("q", "dq", "tau"), ("kp", "kd")
"""Fields of a motor in the messages."""


@dataclass
class Fault:
    """A fault of a simulated robot; raises BadInput of another kind than of KINDS."""

    kind: str = NO_FAULT
    start: int = 0
    """State from which on it is there, counted from the first command; 0: always."""
    motor: int = 0
    """That it is of, 0 to 11; the leg of this motor and the next leg are swapped."""
    _first: Message | None = field(default=None, init=False)
    """State when it began."""
    _lost: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        require_name("--fault", self.kind, KINDS)
        self._random = np.random.default_rng(0)

    def spoil_command(self, command: Message, step: int) -> Message | None:
        """A command as it reaches the motors; None: it is lost."""
        if step < self.start:
            return command
        if self.kind == "lost_commands" and self._random.random() < PART:
            self._lost += 1
            return None
        if self.kind in ("sign", "swapped"):
            self._disturb(command["motor_cmd"], COMMANDED if self.kind == "sign" else (*COMMANDED, *GAINS))
            command["crc"] = compute_checksum(command)
        return command

    def spoil_state(self, state: Message, step: int) -> Message | None:
        """A state as it is sent; None: it is not."""
        if step < self.start:
            return state
        is_held_back = self.kind == "late" and (step - self.start) % EVERY < BURST
        if is_held_back or (self.kind == "lost_states" and self._random.random() < PART):
            return None
        first = self._first = state.copy() if self._first is None else self._first
        sent = (first if self.kind.startswith("frozen") else state).copy()
        motors = sent["motor_state"]
        motors["lost"] = self._lost
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
            case "hot":
                motors["temperature"][self.motor] = 90
            case "empty":
                sent["power_v"] = 20.0
        return sent

    def _disturb(self, motors: Message, names: Sequence[str]) -> None:
        """Turn the sign of these numbers of one motor, or exchange those of two legs."""
        own, other = self.motor // 3, (self.motor // 3 + 1) % 4
        for name in names:
            legs = motors[name][:12].reshape(4, 3)
            if self.kind.startswith("sign"):
                motors[name][self.motor] *= -1.0
            else:
                legs[[own, other]] = legs[[other, own]]


HANG = 0.5
"""Height of the feet above the ground while the robot hangs, m."""
RESTS = 3.0
"""Time for which commands rest until the robot is let down, s."""
LOWERING = 0.2
"""Speed of that, m/s."""
ROPES = 1e9
"""Inertia of a trunk that hangs, kg and kg m^2: what the legs do does not move it."""
CARRIES = 0.8
"""Part of its weight that the feet carry when the ropes are slack."""
BELLY = 0.07
"""Least height of the trunk, m."""
SPIN = 2e-4
"""Time before a state is due for which the process no longer sleeps, s."""
IDLE = 5.0
"""Time without a command after which it ends, s, if there were any."""
PATIENCE = 0.5
"""Time for which a patient robot waits for a command, s."""
VOLTAGE, TEMPERATURE = 28.0, 35
"""V and degrees Celsius of a robot that is well."""


class SimulatedRobot:
    """A robot in MuJoCo that takes LowCmd and gives LowState."""

    def __init__(self, config: Config, hung: bool, crouch: Sequence[float]):
        """The robot of a ``config``, with the noise of its sensors, whose legs are in a ``crouch`` (3,), rad.

        Raises BadInput if its plant is not MuJoCo's robot, or its sensors are not those of a robot.
        """
        for group, kind, options in (
            ("plant", MujocoRobot.Config, "mujoco_robot, or mujoco_robot_rigid"),
            ("sensors", ProprioceptiveConfig, "proprioceptive, whose noise the robot has"),
        ):
            node = vars(config)[group]
            option = find_option(group, read_component(node)["_target_"])
            require(isinstance(node, kind), group, option, f"must be {options}")
        scenario = make_scenario(replace(config, cycles=1))
        if scenario.fault is not None:
            raise scenario.fault
        plant: MujocoRobot = scenario.plant  # type: ignore[assignment]
        self.plant, self.period, self.hung, mechanism = plant, config.sampling_period, hung, scenario.setup.mechanism
        self.weight, limits, legs = mechanism.weight, mechanism.torque_limits, mechanism.shape[0]
        actuator = replace(config.actuator, delay=config.actuator.delay + config.plant.delay)
        self.drives = new_drives(actuator, config.plant.bus, self.period, config.plant.substeps, limits, legs)
        self._advance, self._send = program(advance_engine, is_timed=True), program(send_command, is_timed=True)
        self._nothing = np.zeros(mechanism.shape)
        robot, data = read_model(config.machine), plant.data
        at, rate = robot.legs.base_qpos, int(plant.model.jnt_dofadr[plant.model.body_jntadr[robot.legs.base]])
        data.qpos[robot.legs.qpos] = crouch
        plant.mujoco.mj_kinematics(plant.model, data)
        data.qpos[at + 2] += (HANG if hung else 0.0) - data.geom_xpos[robot.legs.foot_geom, 2].min()
        plant.mujoco.mj_step1(plant.model, data)
        self._base_inertia = plant.model.dof_armature[rate : rate + 6]
        self._base_inertia[:] = ROPES  # also of one that lies, until it hears a command
        self._base, self._base_rate = data.qpos[at : at + 7], data.qvel[rate : rate + 6]
        self._held = self._base.copy()
        self._rested = 0.0
        self._command = np.zeros((6, *self._nothing.shape))
        self.steps = 0
        self._random, self._sensors = np.random.default_rng(config.seed), config.sensors
        self.step()  # which compiles what a step needs

    def take(self, command: Message) -> None:
        """Follow a command; one with a wrong checksum is ignored, as by a robot."""
        if command["crc"] != compute_checksum(command):
            return
        parts = {"tau": TORQUE, "q": ANGLE, "dq": VELOCITY, "kp": STIFFNESS, "kd": DAMPING}
        for name, part in parts.items():
            self._command[part] = get_motors(command["motor_cmd"][name])

    def step(self) -> None:
        """Advance by one sampling period under the last command."""
        rests = np.array_equal(self._command[ANGLE], self.drives.command[ANGLE]) and self._command[STIFFNESS].any()
        self._rested = self._rested + self.period if rests else 0.0
        self.drives.command[...] = self._command
        with interrupt_held_back():
            self._send(self.drives, self.steps, self._command[TORQUE], self._nothing)
            self._support()
            self._advance(self.plant.engine, self.plant.state, self._nothing, self.drives)
        self.steps += 1

    def _support(self) -> None:
        """Hold the trunk where it hangs, and let it down once commands rest; on the ground it lies on its belly."""
        base, rate = self._base, self._base_rate
        if not self.hung and self._command.any():
            self._base_inertia[:] = 0.0
            if base[2] < BELLY:
                base[2], rate[2] = BELLY, max(rate[2], 0.0)
            return
        sinks = self.hung and self._rested > RESTS
        self._held[2] -= LOWERING * self.period if sinks else 0.0
        base[:], rate[:] = self._held, 0.0
        if sinks and self.plant.state.force.sum() > CARRIES * self.weight:
            self.hung, self._base_inertia[:] = False, 0.0

    def fill(self, state: Message) -> None:
        """Write what the robot measures into a LowState, all but its tick."""
        signals, imu, motors = self.plant.signals, state["imu_state"], state["motor_state"]
        assert signals is not None
        imu["quaternion"] = self._base[3:]
        sensors, every = self._sensors, slice(None)
        for numbers, place, values, sensor in (
            (imu["gyroscope"], every, signals.gyroscope, sensors.gyroscope),
            (imu["accelerometer"], every, signals.accelerometer, sensors.accelerometer),
            (motors["q"], JOINTS, signals.q, sensors.position),
            (motors["dq"], JOINTS, signals.dq, sensors.velocity),
            (motors["tau_est"], JOINTS, signals.torque, sensors.torque),
        ):
            numbers[place] = values + self._random.normal(0.0, sensor.noise, values.shape)
        state["foot_force"][JOINTS[:, 0] // JOINTS.shape[1]] = np.clip(self.plant.state.force, 0, 32767)


def play(robot: SimulatedRobot, interface: str, domain: int, seconds: float, fault: Fault, patient: bool) -> str:
    """Play a robot for so many ``seconds``, or until commands cease; how it went, in one line.

    A ``patient`` one waits for the answer to each state, once there were any, and takes as long as that takes.
    """
    state = np.zeros((), LOW_STATE)
    state["head"] = HEADER
    state["level_flag"] = LEVEL_LOW
    state["power_v"] = VOLTAGE
    state["motor_state"]["temperature"] = TEMPERATURE
    if not patient:
        run_first(True)
        gc.disable()  # it takes longer than several steps
    wire = Wire(interface, domain, STATES, COMMANDS)
    print(
        f"a robot on {interface}, domain {domain}: {'it hangs' if robot.hung else 'it lies on the ground'}",
        flush=True,
    )
    begun = heard = time.perf_counter()
    age = 0 if fault.start == 0 else -1  # of the robot, for its faults: states since the first command
    taken = late = 0
    worst = 0.0
    end = begun + seconds
    while (now := time.perf_counter()) < end and (not taken or now - heard < IDLE):
        command = wire.receive(PATIENCE if patient and taken else 0.0)
        if command is not None and (command := fault.spoil_command(command, age)) is not None:
            heard, taken = now, taken + 1
            robot.take(command)
        robot.step()
        robot.fill(state)
        state["tick"] = robot.steps
        age += taken > 0
        if (spoilt := fault.spoil_state(state, age)) is not None:
            wire.send(spoilt)
        if patient and taken:
            continue
        due = begun + robot.steps * robot.period
        late += (lag := time.perf_counter() - due) > robot.period / 2
        worst = max(worst, lag)
        begun += lag if lag > robot.period else 0.0  # it does not catch up
        while (left := due - time.perf_counter()) > 0.0:
            time.sleep(left - SPIN if left > 2 * SPIN else 0.0)
    tilt, height = np.abs(robot.plant.state.body[1:]).max(), robot.plant.state.body[0]
    return (
        f"{robot.steps - 1} states, {taken} commands, {late} late by up to {1e3 * worst:.2g} ms; at the end its body "
        f"is at {height:.3f} m, tilted by {tilt:.2g} rad"
    )
