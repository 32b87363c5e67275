"""A simulated robot at the other end of the wire: MuJoCo in real time, sends LowState and receives LowCmd.

It is the robot of ``plant=mujoco_robot_rigid`` with the drives of :mod:`cmacexp.plants.drives`; lag, delay of
commands and differences from its model are those of its config. It hangs at first, as a real robot should, and is let
down once its commands have been constant for a while; or it lies on the ground. Without new commands its motors
repeat the last one; it ends when it was only damped for a while. To practise failures it can have a fault
(:mod:`cmacexp.addons.unitree.faults`).
"""

import gc
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cmacexp.addons.unitree.faults import Fault
from cmacexp.addons.unitree.messages import (
    HEADER,
    JOINTS,
    LEVEL_LOW,
    LOW_STATE,
    Message,
    compute_checksum,
    get_motors,
    is_damping,
)
from cmacexp.addons.unitree.network import LOOPBACK, STATES, Wire, run_first
from cmacexp.config.component import find_option
from cmacexp.config.schema import Config, read_component
from cmacexp.errors import require
from cmacexp.jit.compiler import program
from cmacexp.jit.interrupt import interrupt_held_back
from cmacexp.loop.scenario import make_scenario
from cmacexp.plants.drives import ANGLE, DAMPING, STIFFNESS, TORQUE, VELOCITY, new_drives, send_command
from cmacexp.plants.mujoco_kernels import advance_engine
from cmacexp.plants.mujoco_robot import MujocoRobot
from cmacexp.sensors.proprioceptive import ProprioceptiveConfig

HANG = 0.5
"""Height of the feet above the ground while the robot hangs, m."""
RESTS = 3.0
"""Time of constant commands after which the robot is let down, s."""
LOWERING = 0.2
"""Speed at which the robot is let down, m/s."""
ROPES = 1e9
"""Inertia added to a trunk that hangs, kg and kg m^2, so large that the legs do not move it."""
CARRIES = 0.8
"""Part of its weight on the feet above which the ropes are released."""
BELLY = 0.07
"""Height of the trunk when it lies on its belly, m."""
SPIN = 2e-4
"""Time before a state is due in which the process polls instead of sleeping, s."""
IDLE = 5.0
"""Time without a command that moves the robot after which the simulation ends, s, once it has received one."""
LONGEST = 3600.0
"""Time after which the simulation ends even if commands continue, s."""
PATIENCE = 0.5
"""Time for which a patient robot waits for a command, s."""
VOLTAGE = 28.0
"""Voltage of a battery without a fault, V."""
TEMPERATURE = 35
"""Temperature of motors without a fault, degrees Celsius."""


class SimulatedRobot:
    """A robot in MuJoCo that follows LowCmd and fills LowState."""

    def __init__(self, config: Config, hung: bool, crouch: Sequence[float]):
        """Make the robot of a ``config``, with noise of its sensors, and all legs in the pose ``crouch`` (3,), rad.

        It starts ``hung``, or on the ground. Raises BadInput unless the plant is MuJoCo's robot and the sensors are
        those of a robot.
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
        self.plant = plant
        self.period = config.sampling_period
        self.hung = hung
        mechanism = scenario.setup.mechanism
        self.weight = mechanism.weight
        actuator = replace(config.actuator, delay=config.actuator.delay + config.plant.delay)
        self.drives = new_drives(
            actuator,
            config.plant.bus,
            self.period,
            config.plant.substeps,
            mechanism.torque_limits,
            mechanism.shape[0],
        )
        self._advance = program(advance_engine, is_timed=True)
        self._send = program(send_command, is_timed=True)
        self._nothing = np.zeros(mechanism.shape)
        data = plant.data
        legs = plant.robot.legs
        at = legs.base_qpos
        rate = int(plant.model.jnt_dofadr[plant.model.body_jntadr[legs.base]])
        data.qpos[legs.qpos] = crouch
        plant.mujoco.mj_kinematics(plant.model, data)
        data.qpos[at + 2] += (HANG if hung else 0.0) - data.geom_xpos[legs.foot_geom, 2].min()
        plant.mujoco.mj_step1(plant.model, data)
        self._base_inertia = plant.model.dof_armature[rate : rate + 6]
        self._base_inertia[:] = ROPES  # also of a robot that lies, until it receives a command
        self._base, self._base_rate = data.qpos[at : at + 7], data.qvel[rate : rate + 6]
        self._held = self._base.copy()
        self._rested = 0.0
        self._command = np.zeros((6, *self._nothing.shape))
        self.steps = 0
        self._random = np.random.default_rng(config.seed)
        self._sensors = config.sensors
        self.step()  # compiles the programs of a step before the first command

    def take(self, command: Message) -> None:
        """Set the command of the drives; a command with a wrong checksum is ignored, as by a real robot."""
        if command["crc"] != compute_checksum(command):
            return
        for name, row in (("tau", TORQUE), ("q", ANGLE), ("dq", VELOCITY), ("kp", STIFFNESS), ("kd", DAMPING)):
            self._command[row] = get_motors(command["motor_cmd"][name])

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
        """Hold the trunk of a robot that hangs, and let it down once its commands are constant.

        On the ground, the trunk is held until the first command, and never sinks below BELLY.
        """
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
            self.hung = False
            self._base_inertia[:] = 0.0

    def fill(self, state: Message) -> None:
        """Write the measurements of the robot into a LowState, except for its tick."""
        signals = self.plant.signals
        imu, motors = state["imu_state"], state["motor_state"]
        assert signals is not None
        imu["quaternion"] = self._base[3:]
        sensors = self._sensors
        for numbers, index, values, sensor in (
            (imu["gyroscope"], ..., signals.gyroscope, sensors.gyroscope),
            (imu["accelerometer"], ..., signals.accelerometer, sensors.accelerometer),
            (motors["q"], JOINTS, signals.q, sensors.position),
            (motors["dq"], JOINTS, signals.dq, sensors.velocity),
            (motors["tau_est"], JOINTS, signals.torque, sensors.torque),
        ):
            numbers[index] = values + self._random.normal(0.0, sensor.noise, values.shape)
        state["foot_force"][JOINTS[:, 0] // JOINTS.shape[1]] = np.clip(self.plant.state.force, 0, 32767)


def play(robot: SimulatedRobot, domain: int, fault: Fault, patient: bool) -> str:
    """Simulate a robot on this computer until commands stop; return one line about the course of the simulation.

    A ``patient`` robot waits for the command that answers each state, after the first command, instead of running in
    real time.
    """
    state = np.zeros((), LOW_STATE)
    state["head"] = HEADER
    state["level_flag"] = LEVEL_LOW
    state["power_v"] = VOLTAGE
    state["motor_state"]["temperature"] = TEMPERATURE
    if not patient:
        run_first(True)
        gc.disable()  # a collection takes longer than several steps
    wire = Wire(LOOPBACK, domain, STATES)
    pose = "it hangs" if robot.hung else "it lies on the ground"
    print(f"a robot on {LOOPBACK}, domain {domain}: {pose}", flush=True)
    begun = last_command = time.perf_counter()
    age = 0 if fault.start == 0 else -1  # number of states since the first command; faults begin at some age
    commands = late = 0
    worst = 0.0
    end = begun + LONGEST
    while (now := time.perf_counter()) < end and (not commands or now - last_command < IDLE):
        command = wire.receive(PATIENCE if patient and commands else 0.0)
        if command is not None and (command := fault.spoil_command(command, age)) is not None:
            moves = not is_damping(command)  # the guardian of an earlier run may still damp the robot
            last_command = now if moves else last_command
            commands += moves or commands > 0
            robot.take(command)
        robot.step()
        robot.fill(state)
        state["tick"] = robot.steps
        age += commands > 0
        if (lasts := fault.stall(age)) > 0.0:
            time.sleep(lasts)
        if (spoilt := fault.spoil_state(state, age)) is not None:
            wire.send(spoilt)
        if patient and commands:
            continue
        due = begun + robot.steps * robot.period
        late += (lag := time.perf_counter() - due) > robot.period / 2
        worst = max(worst, lag)
        begun += lag if lag > robot.period else 0.0  # lost time is not caught up
        while (left := due - time.perf_counter()) > 0.0:
            time.sleep(left - SPIN if left > 2 * SPIN else 0.0)
    height, *tilt = robot.plant.state.body
    return (
        f"{robot.steps - 1} states, {commands} commands, {late} late by up to {1e3 * worst:.2g} ms; at the end its "
        f"body is at {height:.3f} m, tilted by {np.abs(tilt).max():.2g} rad"
    )
