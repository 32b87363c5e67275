"""A Unitree robot on a network as a plant: it stands up, walks, sits down, and is damped.

The drives of the robot close the joint loops, so that the controller must be one of drives. The robot only reports
LowState: the state that this plant returns comes from an estimator (:mod:`cmacexp.sensors.proprioceptive`).
"""

import math
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np

from cmacexp.addons.unitree.guardian import Guardian
from cmacexp.addons.unitree.hung import SOFT, check_joints, find_holding_torque, touch_joints, wait_for_ground
from cmacexp.addons.unitree.link import Gains, Link
from cmacexp.addons.unitree.log import Log
from cmacexp.addons.unitree.network import MOST
from cmacexp.addons.unitree.service import release_sport_mode
from cmacexp.addons.unitree.states import LimitsConfig, name_joint
from cmacexp.config import ComponentConfig, Config, number
from cmacexp.config.component import find_option
from cmacexp.config.machine import RobotMachine, read_model
from cmacexp.config.schema import read_component
from cmacexp.data.signals import LIVE_SIGNALS
from cmacexp.errors import BadInput, require
from cmacexp.jit.compiler import program
from cmacexp.models.leg import GRAVITY
from cmacexp.planning.plan import Setup
from cmacexp.plants.drives import ReceiverConfig
from cmacexp.protocols import Drive, Measurement, RobotSignals
from cmacexp.sensors.estimator import estimate
from cmacexp.sensors.proprioceptive import ProprioceptiveConfig, ProprioceptiveSensors
from cmacexp.typing import Array

PLAY = 0.1
"""Tolerance of the joint ranges of the model, rad."""
SETTLES = 1.0
"""Duration of the transition from walking to the standing pose, s."""
AUTO = "auto"
"""Value of ``plant.log`` for a file named by the time."""


class Stage(StrEnum):
    """Stages of a run on a robot, in this order."""

    CONNECT = "connect"
    CHECK = "check while it hangs"
    CROUCH = "crouch"
    TOUCH = "check while it lies"
    LOWER = "wait for the ground"
    STAND = "stand up"
    WALK = "walk"
    SWING = "swing while it hangs"
    SIT = "sit down"
    DAMP = "damp"


class UnitreeRobot:
    """A Go2, or another robot with LowCmd and LowState."""

    @dataclass(kw_only=True)
    class Config(ComponentConfig):
        """Network, stages of a run, and limits."""

        interface: str = field()
        """Network interface to the robot. lo: a robot simulated on this computer by ``cmacexp robot --simulate``."""
        domain: int = number("", at_least=0, at_most=MOST)
        """DDS domain; 0 on a real robot."""
        hung: bool = field()
        """true: the robot hangs; its joints are checked, then it is let down. false: it lies on the ground."""
        release: bool = field()
        """true: end the motion program (sport mode) of the robot first. false: none runs."""
        let_down: float = number("s", above=0, at_most=3600)
        """Longest time until a robot that was let down stands on the ground."""
        rise: float = number("s", above=0, at_most=60)
        """Duration of standing up, and of sitting down."""
        blend: float = number("s", above=0, at_most=60)
        """Duration of the transition from the standing pose to the commands of the controller."""
        guardian: float = number("s", above=0, at_most=10)
        """Time without a command after which the guardian, a separate process, holds the robot ever more softly;
        ``limits.silence`` later it damps it."""
        damping: float = number("N m s/rad", above=0, at_most=100)
        """Damping of the joints when the robot is damped."""
        crouch: list[float] = number("rad", at_least=-7, at_most=7)
        """Angles of hip, thigh and calf when the robot sits."""
        log: str | None = field()
        """Parquet file for states and commands; ``cmacexp gap`` reads it if kp and kd are constant. auto: one in
        outputs/robot, named by the time; null: no file."""
        bus: ReceiverConfig = field()
        limits: LimitsConfig = field()
        estimator: ProprioceptiveConfig = field()
        """State estimator. Its sensor imperfections are for simulations; a real robot has its own."""

        def check(self, config: Config) -> None:
            """Check that the rest of the config suits a robot with its own drives and estimator; raise BadInput."""
            kind = config.machine.kind
            model = config.machine.model if isinstance(config.machine, RobotMachine) else None
            learning = config.learning
            sharing = config.force_control.load_sharing
            gains = read_component(config.controller)
            controller = find_option("controller", gains["_target_"])
            sensors = find_option("sensors", read_component(config.sensors)["_target_"])
            by_itself = "with plant=unitree, which estimates by itself"
            file = "go2, or machine.path=FILE of a robot with its motors, with plant=unitree"
            blends = "null with plant=unitree, whose first cycle blends from standing"
            planned = "dynamic or static with plant=unitree: making a plan takes longer than a step"
            first = 2 + math.ceil(self.blend / config.gait.cycle_time)
            after = f"at least {first} with plant.blend={self.blend:g}: a cycle of feedback only comes before"
            for key, value, fits, allowed in (
                ("machine.kind", kind, kind == "robot", "robot with plant=unitree: use scenario=robot"),
                ("controller", controller, controller == "drives", f"drives {by_itself}"),
                ("sensors", sensors, sensors == "perfect", f"perfect {by_itself}"),
                ("machine", model, model in (None, "go2"), file),
                ("learning.start_from", learning.start_from, learning.start_from is None, blends),
                ("force_control.load_sharing", sharing, sharing != "adaptive", planned),
                ("plant.crouch", self.crouch, len(self.crouch) == 3, "three angles: hip, thigh, calf"),
                ("learning.start_cycle", learning.start_cycle, learning.start_cycle >= first, after),
            ):
                require(fits, key, value, f"must be {allowed}")
            for name in ("stiffness", "damping"):
                most = vars(self.limits)[name]
                allowed = f"must be at most plant.limits.{name}={most:g}"
                require(gains[name] <= most, f"controller.{name}", gains[name], allowed)

    takes_drives = True
    link: Link
    """Link to the robot, from :meth:`reset` on."""

    def __init__(self, config: "UnitreeRobot.Config"):
        self.config = config
        self.stages: list[tuple[Stage, float]] = []
        """Stages with the times at which they began, s on the clock of ``time.perf_counter``."""
        self.steps: list[tuple[float, int]] = []
        """Values of LIVE_SIGNALS in each step in which a command was sent."""
        self.heading = 0.0
        """Yaw of the inertial unit when the walk began, rad."""
        self.trouble: str | None = None
        """Failure after the end of the run, whose results are kept."""
        self._estimate: Any = program(estimate, is_timed=True)

    def reset(self, setup: Setup) -> Measurement:
        """Connect to the robot and check it at rest; it does not move before the first :meth:`step`.

        Returns the measurement of a robot that stands as planned. Raises BadInput if no robot answers, or if it is
        not fit to stand up.
        """
        config = self.config
        machine = setup.config.machine
        assert isinstance(machine, RobotMachine)
        log = self._name_log()
        require(log is None or log.parent.is_dir(), "plant.log", config.log, "must lie in a folder that exists")
        self.setup = setup
        self.robot = read_model(machine)
        self.stand = np.ascontiguousarray(setup.start)
        self.sensors = ProprioceptiveSensors(config.estimator)
        self.sensors.reset(setup)
        still = np.zeros_like(self.stand)
        acceleration = np.array([0.0, 0.0, GRAVITY])
        first = self._measure(
            RobotSignals(self.stand, still, still, np.zeros(3), np.zeros(3), acceleration, np.zeros(1))
        )
        self._enter(Stage.CONNECT)
        released = release_sport_mode(config.interface, config.domain) if config.release else "not looked for"
        link = self.link = Link(config.interface, config.domain, setup.config.sampling_period, config.limits)
        self._require_ranges("plant.interface", config.interface, link.signals.q)
        self.crouch = np.array([config.crouch] * len(self.stand))
        self._require_ranges("plant.crouch", config.crouch, self.crouch)
        link.guardian = Guardian(
            config.interface, config.domain, config.damping, config.guardian, config.limits.silence
        )
        if log is not None:
            joints = [self.robot.model.joint(int(joint)).name for joint in self.robot.legs.joint.ravel()]
            link.log = Log(log, link.period, joints)
        self._print_checklist(released)
        return first

    def _name_log(self) -> Path | None:
        """Return the name of the log, whose folder exists if it is named by the time."""
        if self.config.log != AUTO:
            return None if self.config.log is None else Path(self.config.log)
        folder = Path("outputs") / "robot"
        folder.mkdir(parents=True, exist_ok=True)
        return folder / time.strftime("%Y-%m-%d_%H-%M-%S.parquet")

    def _print_checklist(self, released: str) -> None:
        """Print what was checked, and what a person must check, before the first command that moves the robot."""
        config, link = self.config, self.link
        reading = link.first
        limits = config.limits
        for line in (
            f"robot on {config.interface}, domain {config.domain}: states every {1e3 * link.period:g} ms, "
            f"{reading.voltage:.1f} V, hottest motor {reading.temperature:.0f} degrees Celsius",
            f"sport mode: {released}; no other sender of commands",
            f"it {'hangs, no foot reaches the ground' if config.hung else 'lies on its belly, on level ground'}; "
            "people stay clear; a person holds the remote control: L2 and B stop the robot",
            f"at most {limits.torque:g} N m, {limits.stiffness:g} N m/rad, {limits.damping:g} N m s/rad; "
            f"log: {link.log.path if link.log else 'none'}",
            f"at the end process {link.guardian.number} damps it, until another program moves it or you end it: "
            f"kill {link.guardian.number}",
        ):
            print(f"[ ] {line}", file=sys.stderr)

    def _require_ranges(self, key: str, value: object, q: Array) -> None:
        """Check that angles ``q`` (4, 3), rad, are in the model's ranges; raise BadInput for this ``key``."""
        ranges = self.robot.ranges
        for leg, joint in np.argwhere((q < ranges[..., 0] - PLAY) | (q > ranges[..., 1] + PLAY)).tolist():
            raise BadInput(
                key, value, f"{name_joint(leg, joint)} is at {q[leg, joint]:.3g} rad, which the model does not allow"
            )

    def step(self, torque: Array, drive: Drive | None = None) -> Measurement:
        """Send a command and wait for the next state; in the first step the robot stands up before.

        Raises Unsafe when the robot or the network exceeds a limit: the run ends, and :meth:`end_run` damps it.
        """
        assert drive is not None  # Config.check requires a controller of drives
        link = self.link
        if self.stages[-1][0] != Stage.WALK:
            self._stand_up((float(drive.stiffness.max()), float(drive.damping.max())))
        share = min(1.0, len(self.steps) * link.period / self.config.blend)
        angle = share * drive.q + (1.0 - share) * self.stand
        link.send(angle, share * drive.dq, share * torque, drive.stiffness, drive.damping)
        self.steps.append((time.perf_counter() - link.arrived, link.watch.missed))
        link.receive()
        return self._measure(link.signals)

    def move_hung(self, move: Callable[[Link, Array], Array | None]) -> Array | None:
        """Check the joints of a robot that hangs, then call ``move`` and return its result; raise Unsafe.

        ``move``, such as :func:`cmacexp.addons.unitree.hung.draw_chirp`, takes the link and the standing pose (4, 3),
        rad.
        """
        self._enter(Stage.CHECK)
        self.link.begin(self.config.damping)
        check_joints(self.link, self.stand, find_holding_torque(self.robot, self.stand))
        self._enter(Stage.SWING)
        if self.link.log is not None:
            self.link.log.clear()
        return move(self.link, self.stand)

    def end_run(self, is_safe: bool) -> None:
        """Sit down if the robot ``is_safe``, damp it unless it was never moved, and write the log.

        From then on its guardian damps it.
        """
        link = self.link
        last = self.stages[-1][0]
        if is_safe and last in (Stage.WALK, Stage.STAND):
            with self._keep_results(self._enter(Stage.SIT)):
                link.move(self.stand, SETTLES, self.gains)
                link.move(self.crouch, self.config.rise, self.gains)
        if last != Stage.CONNECT:
            with self._keep_results(self._enter(Stage.DAMP)):
                link.damp(self.config.damping)
        link.end()
        if link.log is not None:
            with self._keep_results(f"log {link.log.path}"):  # a full disk costs only the log
                link.log.close()

    @contextmanager
    def _keep_results(self, what: str) -> Iterator[None]:
        """Print a failure at the end of the run and keep it for the manifest, instead of raising it."""
        try:
            yield
        except Exception as error:
            self.trouble = " ".join(f"{what}: {error}".split())
            print(f"warning: the robot, {self.trouble}", file=sys.stderr)

    def list_steps(self, start: int, stop: int) -> dict[str, Array]:
        """Return LIVE_SIGNALS of steps ``start`` to ``stop`` by name, (stop - start,); NaN if no command was sent."""
        rows = np.full((stop, len(LIVE_SIGNALS)), np.nan)
        rows[: len(self.steps)] = np.reshape(self.steps[:stop], (-1, len(LIVE_SIGNALS)))
        return {signal.name: values for signal, values in zip(LIVE_SIGNALS, rows[start:].T, strict=True)}

    def describe(self) -> dict[str, Any]:
        """Return the entries of the manifest: stages, missed states, and the computing time of the steps."""
        late = np.array([answer for answer, _ in self.steps])
        return {
            "stages": [
                {"stage": str(stage), "second": round(at - self.stages[0][1], 3)} for stage, at in self.stages
            ],
            "trouble": self.trouble,
            "states_missed": self.link.watch.missed,
            "steps_overran": int((late > self.link.period).sum()),
            "work_ms": {
                name: round(1e3 * float(np.quantile(late, share)), 3)
                for name, share in {"median": 0.5, "p99": 0.99, "p99.9": 0.999, "worst": 1.0}.items()
                if self.steps
            },
        }

    def _enter(self, stage: Stage) -> Stage:
        """Begin a stage, and return it."""
        self.stages.append((stage, time.perf_counter()))
        return stage

    def _stand_up(self, gains: Gains) -> None:
        """Check the robot, wait until it is let down if it hangs, and stand up with ``gains``; raise Unsafe."""
        self.gains = gains
        link = self.link
        self._enter(Stage.CHECK if self.config.hung else Stage.CROUCH)
        link.begin(self.config.damping)
        if self.config.hung:
            check_joints(link, self.stand, find_holding_torque(self.robot, self.stand))
            self._enter(Stage.LOWER)
            wait_for_ground(
                link,
                self.stand,
                gains,
                self._estimate_force,
                self.setup.mechanism.weight,
                self.config.let_down,
            )
        else:
            link.move(self.crouch, self.config.rise, SOFT)
            self._enter(Stage.TOUCH)
            touch_joints(link, self.crouch, gains)
        self._enter(Stage.STAND)
        link.move(self.stand, self.config.rise, gains)
        self._enter(Stage.WALK)
        self.sensors.reset(self.setup)
        self.heading = float(link.signals.attitude[2])
        self._measure(link.signals)

    def _estimate_force(self, signals: RobotSignals) -> float:
        """Estimate the total force on the feet of a robot at rest, N."""
        self.sensors.step = 0
        return float(self._measure(signals).force.sum())

    def _measure(self, signals: RobotSignals) -> Measurement:
        """Estimate the state of the robot from its ``signals``; yaw is relative to ``heading``."""
        pitch, roll, yaw = signals.attitude
        turned = np.array([pitch, roll, math.remainder(yaw - self.heading, 2.0 * math.pi)])
        signals = signals._replace(attitude=turned)
        return self.sensors.observe(signals, self._estimate)._replace(signals=signals)
