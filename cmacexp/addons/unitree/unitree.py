"""A robot of Unitree at the other end of a wire, as a plant: it stands up, walks, sits down, and is damped.

The robot's own drives close the joint loops, so a controller of drives is needed. Nothing but LowState is known of
the robot: the state that this plant returns is that of an estimator (:mod:`cmacexp.sensors.proprioceptive`).
"""

import math
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from cmacexp.addons.unitree.guardian import Guardian
from cmacexp.addons.unitree.hung import check_joints, find_holding_torque, wait_for_ground
from cmacexp.addons.unitree.link import Gains, Link
from cmacexp.addons.unitree.network import MOST
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
from cmacexp.protocols import Drive, Measurement, RobotSignals
from cmacexp.sensors.estimator import estimate
from cmacexp.sensors.proprioceptive import ProprioceptiveConfig, ProprioceptiveSensors
from cmacexp.typing import Array

PLAY = 0.1
"""Angle by which an encoder may be beyond the range of its joint, rad."""


class Stage(StrEnum):
    """What a robot does, in this order."""

    CONNECT = "connect"
    CHECK = "check while it hangs"
    LOWER = "wait for the ground"
    STAND = "stand up"
    WALK = "walk"
    SWING = "swing while it hangs"
    SIT = "sit down"
    DAMP = "damp"


class UnitreeRobot:
    """A Go2, or another robot that speaks LowCmd and LowState."""

    @dataclass(kw_only=True)
    class Config(ComponentConfig):
        """The wire, the stages and the limits."""

        interface: str = field()
        """Network interface to the robot; lo: this computer, on which ``cmacexp robot --simulate`` plays one."""
        domain: int = number("", at_least=0, at_most=MOST)
        """Domain of DDS; 0 on a robot."""
        hung: bool = field()
        """The robot hangs: its joints are checked one by one, then it is let down. false: it lies on the ground."""
        let_down: float = number("s", above=0, at_most=3600)
        """Longest time until a robot that hung stands."""
        rise: float = number("s", above=0, at_most=60)
        """Time in which it stands up, and sits down."""
        blend: float = number("s", above=0, at_most=60)
        """Time in which the commands of the controller take over from standing."""
        guardian: float = number("s", above=0, at_most=10)
        """Time without a command after which a process of its own damps the robot."""
        damping: float = number("N m s/rad", above=0, at_most=100)
        """Damping of the joints of a robot that is damped."""
        crouch: list[float] = number("rad", at_least=-7, at_most=7)
        """Hip, thigh and calf of a robot that sits."""
        log: str | None = field()
        """Parquet file for what is measured and sent; ``cmacexp gap`` reads rows of one pair of gains. null: none."""
        limits: LimitsConfig = field()
        estimator: ProprioceptiveConfig = field()
        """What makes a state of what the robot measures; its imperfections are those of a simulation: none here."""

        def check(self, config: Config) -> None:
            """Check that its drives get commands, and that nothing else has the state altered."""
            kind, model = (
                config.machine.kind,
                config.machine.model if isinstance(config.machine, RobotMachine) else None,
            )
            start, sharing = config.learning.start_from, config.force_control.load_sharing
            controller, sensors = (
                find_option(group, read_component(vars(config)[group])["_target_"])
                for group in ("controller", "sensors")
            )
            by_itself = "with plant=unitree, which estimates by itself"
            file = "go2, or machine.path=FILE of a robot with its motors, with plant=unitree"
            blends = "null with plant=unitree, whose first cycle blends from standing"
            planned = "dynamic or static with plant=unitree: making a plan takes longer than a step"
            for key, value, fits, allowed in (
                ("machine.kind", kind, kind == "robot", "robot with plant=unitree: use scenario=robot"),
                ("controller", controller, controller == "drives", f"drives {by_itself}"),
                ("sensors", sensors, sensors == "perfect", f"perfect {by_itself}"),
                ("machine", model, model in (None, "go2"), file),
                ("learning.start_from", start, start is None, blends),
                ("force_control.load_sharing", sharing, sharing != "adaptive", planned),
                ("plant.crouch", self.crouch, len(self.crouch) == 3, "three angles: hip, thigh, calf"),
            ):
                require(fits, key, value, f"must be {allowed}")

    takes_drives = True
    link: Link
    """Its link to the robot, from :meth:`reset` on."""

    def __init__(self, config: "UnitreeRobot.Config"):
        self.config = config
        self.stages: list[tuple[Stage, float]] = []
        """Each with the time at which it began, s on the clock of ``time.perf_counter``."""
        self.steps: list[tuple[float, int]] = []
        """What LIVE_SIGNALS name, of each step in which a command was sent."""
        self.heading = 0.0
        """Yaw of the inertial unit when the walk began, rad."""
        self.trouble: str | None = None
        """What went wrong when the run had ended; its results are kept."""
        self._estimate: Any = program(estimate, is_timed=True)

    def reset(self, setup: Setup) -> Measurement:
        """Connect, and check what can be checked at rest; nothing moves before the first :meth:`step`.

        The measurement is that of a robot that stands as planned. Raises BadInput if no robot answers, or if it is
        not fit to stand up.
        """
        config, machine = self.config, setup.config.machine
        assert isinstance(machine, RobotMachine)
        has_folder = config.log is None or Path(config.log).parent.is_dir()
        require(has_folder, "plant.log", config.log, "must lie in a folder that exists")
        self.setup, self.robot, self.stand = setup, read_model(machine), np.ascontiguousarray(setup.start)
        self.expected = find_holding_torque(self.robot, self.stand)
        self.sensors = ProprioceptiveSensors(config.estimator)
        self.sensors.reset(setup)
        still, nothing, level = np.zeros_like(self.stand), np.zeros(3), np.array([0.0, 0.0, GRAVITY])
        first = self._measure(RobotSignals(self.stand, still, still, nothing, nothing, level, np.zeros(1)))
        self._enter(Stage.CONNECT)
        period, log = setup.config.sampling_period, config.log is not None
        self.link = Link(config.interface, config.domain, period, config.limits, log)
        self._require_ranges("plant.interface", config.interface, self.link.signals.q)
        self._require_ranges("plant.crouch", config.crouch, np.array([config.crouch] * len(self.stand)))
        self.link.guardian = Guardian(config.interface, config.domain, config.damping, config.guardian)
        return first

    def _require_ranges(self, key: str, value: object, q: Array) -> None:
        """Check that angles (4, 3), rad, of the ``value`` of a ``key`` are in the model's ranges; raises BadInput."""
        ranges = self.robot.ranges
        for leg, joint in np.argwhere((q < ranges[..., 0] - PLAY) | (q > ranges[..., 1] + PLAY)).tolist():
            raise BadInput(
                key, value, f"{name_joint(leg, joint)} is at {q[leg, joint]:.3g} rad, which the model does not allow"
            )

    def step(self, torque: Array, drive: Drive | None = None) -> Measurement:
        """Send a command and wait for the next state; the first one stands the robot up before.

        Raises Unsafe when the robot, or the wire, is beyond a limit: the run ends, and :meth:`end_run` damps it.
        """
        assert drive is not None  # as Config.check requires of the controller
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
        """Check a robot that hangs, then ``move`` it about the pose (4, 3), rad, in which it stands; raises Unsafe.

        Returns what ``move`` does, :func:`cmacexp.addons.unitree.hung.draw_chirp` or another function of a link and
        that pose.
        """
        self.link.begin()
        self._enter(Stage.CHECK)
        check_joints(self.link, self.stand, self.expected)
        self._enter(Stage.SWING)
        self.link.rows = [] if self.config.log is not None else None
        return move(self.link, self.stand)

    def end_run(self, is_safe: bool) -> None:
        """Sit down if the robot ``is_safe``, and damp it; nothing if it was never moved. Then write the log."""
        last = self.stages[-1][0]
        parts = ((Stage.SIT, self._sit_down), (Stage.DAMP, partial(self.link.damp, self.config.damping)))
        sits = is_safe and last in (Stage.WALK, Stage.STAND)
        for stage, act in () if last == Stage.CONNECT else parts if sits else parts[1:]:
            try:
                self._enter(stage)
                act()
            except Exception as error:  # what was measured is kept, whatever goes wrong at the end
                self._note_trouble(f"{stage}: {error}")
        self.link.end()
        if self.config.log is not None:
            names = [self.robot.model.joint(int(joint)).name for joint in self.robot.legs.joint.ravel()]
            try:
                self.link.write_log(Path(self.config.log), names)
            except OSError as error:  # a disk that is full costs no more than the log
                self._note_trouble(f"{self.config.log} cannot be written: {error.strerror}")

    def _sit_down(self) -> None:
        self.link.move(self.stand, self.config.blend, self.gains)
        self.link.move(np.array([self.config.crouch] * len(self.stand)), self.config.rise, self.gains)

    def _note_trouble(self, trouble: str) -> None:
        """Say what went wrong after the run, here and in the manifest."""
        self.trouble = " ".join(trouble.split())
        print(f"warning: the robot, {self.trouble}", file=sys.stderr)

    def list_steps(self, start: int, stop: int) -> dict[str, Array]:
        """Columns of these steps of the walk, (stop - start,) by name, in the units of LIVE_SIGNALS."""
        rows = np.full((stop, len(LIVE_SIGNALS)), np.nan)
        rows[: len(self.steps)] = np.reshape(self.steps[:stop], (-1, len(LIVE_SIGNALS)))
        return {signal.name: values for signal, values in zip(LIVE_SIGNALS, rows[start:].T, strict=True)}

    def describe(self) -> dict[str, Any]:
        """What the manifest says: stages, states that were missed, and the time that each step took."""
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

    def _enter(self, stage: Stage) -> None:
        self.stages.append((stage, time.perf_counter()))

    def _stand_up(self, gains: Gains) -> None:
        """All that comes before the first step of a walk; raises Unsafe."""
        self.gains = gains
        link, weight = self.link, self.setup.mechanism.weight
        link.begin()
        if self.config.hung:
            self._enter(Stage.CHECK)
            check_joints(link, self.stand, self.expected)
            self._enter(Stage.LOWER)
            wait_for_ground(link, self.stand, gains, self._estimate_force, weight, self.config.let_down)
        self._enter(Stage.STAND)
        link.move(self.stand, self.config.rise, gains)
        self._enter(Stage.WALK)
        self.sensors.reset(self.setup)
        self.heading = float(link.signals.attitude[2])
        self._measure(link.signals)

    def _estimate_force(self, signals: RobotSignals) -> float:
        """The force on all feet of a robot at rest, N."""
        self.sensors.step = 0
        return float(self._measure(signals).force.sum())

    def _measure(self, signals: RobotSignals) -> Measurement:
        """The state of the robot, as estimated, with what it measured; its yaw counts from ``heading`` on."""
        pitch, roll, yaw = signals.attitude
        turned = np.array([pitch, roll, math.remainder(yaw - self.heading, 2.0 * math.pi)])
        signals = signals._replace(attitude=turned)
        return self.sensors.observe(signals, self._estimate)._replace(signals=signals)
