"""The whole control law of a stored run for C: plan, controller, limits, guard, and a check of the C code.

For the check a plant emits pseudo-random signals to the loop of the project, and the commands are summed up.
"""

import sys
from dataclasses import replace
from typing import Any

import numpy as np

from cmacexp.addons.export.network import (
    checksum,
    keep_rows,
    list_path_rows,
    read_final_config,
    read_learnt,
    require_exportable,
)
from cmacexp.config import ComponentConfig, Config
from cmacexp.config.machine import PointMassMachine
from cmacexp.config.schema import ADAPTIVE, ESTIMATE, REFINE
from cmacexp.control import HybridController, steering
from cmacexp.control.actuator import new_actuator
from cmacexp.control.drive_kernels import NEWTON_STEPS, DriveParams
from cmacexp.control.hybrid_kernels import METHODS
from cmacexp.data.run import Run
from cmacexp.errors import BadRun, require
from cmacexp.loop import guard as of_guard
from cmacexp.loop import run_cycles
from cmacexp.loop.builtin import make_guard
from cmacexp.loop.guard_kernels import HIGHEST
from cmacexp.loop.scenario import Scenario, make_scenario
from cmacexp.models import sine
from cmacexp.models.mechanism import (
    KINEMATICS_FIELDS,
    Mechanism,
    compute_foot_position,
    compute_foot_velocity,
    has_body,
    update_kinematics,
)
from cmacexp.models.trend import SIGNIFICANT, TREND_WINDOW
from cmacexp.planning import Setup
from cmacexp.planning.reference import ACTING, BEFORE, X, Y, Z
from cmacexp.plants import Measurement
from cmacexp.protocols import Drive
from cmacexp.sensors import PerfectSensors
from cmacexp.sensors.config import ChannelsConfig
from cmacexp.typing import Array, Status

CYCLES = 4
"""Number of cycles of the check."""
SEED, FACTOR, INCREMENT = 1997, 6364136223846793005, 1442695040888963407
"""Seed, multiplier and increment of a 64-bit linear congruential generator (Knuth, MMIX)."""
ANGLE_AMPLITUDE = 0.05
"""Amplitude of the random joint angles, rad."""
VELOCITY_AMPLITUDE = 0.5
"""Amplitude of the random joint velocities, relative to the largest planned ones."""
FORCE_AMPLITUDE = 0.3
"""Amplitude of the random forces, relative to the mean planned ones."""
FASTEST = 10.0
"""Upper bound of the planned velocity, rad/s: BURST times half of it is below the limit of the loop."""
BODY_AMPLITUDES = (0.002, 0.01, 0.01, 0.05, 0.1, 0.1, 0.002, 0.002, 0.002)
"""Amplitudes of height, pitch and roll, of their rates, and of position and heading: m, rad, s."""
BURST = 16.0
"""Factor of the amplitudes in a part of the third cycle: enough to alarm a guard, but no body falls."""


def compute_feet(mechanism: Mechanism, q: Array, dq: Array) -> tuple[Array, Array]:
    """Compute positions (L, axes), m, and velocities, m/s, of the feet from ``q`` and ``dq`` (L, J), rad, rad/s."""
    kinematics = np.zeros((len(q), KINEMATICS_FIELDS[mechanism.axes]))
    foot, velocity = np.zeros_like(q), np.zeros_like(q)
    update_kinematics(mechanism, q, kinematics)
    for i in range(len(q)):
        compute_foot_position(mechanism, i, kinematics, foot)
        compute_foot_velocity(mechanism, i, kinematics, dq, velocity)
    return foot, velocity


class Player:
    """A plant that emits pseudo-random signals around the start pose and records the resulting commands.

    In the third cycle the amplitudes grow for a while, which alarms a guard.

    Attributes:
        centre: (signals,) mean of the signals, in the order and units of the C code.
        drift: (signals,) increment of the mean in each step.
        size: (signals,) amplitudes in the first cycle; half of them act later.
        commands: command of every step, (numbers,), in the order of the C code.
    """

    takes_drives = True

    def __init__(self) -> None:
        self.commands: list[Array] = []
        self.random = SEED

    def reset(self, setup: Setup) -> Measurement:
        """Start a run and return the signals of its first step."""
        self.mechanism = setup.mechanism
        self.period = len(setup.plan.support)
        legs, joints = setup.mechanism.shape
        angles = legs * joints
        body = has_body(setup.mechanism)
        force = setup.plan.force_desired.mean(axis=0)
        fastest = np.minimum(np.abs(setup.plan.joints.velocity).max(axis=0), FASTEST)
        centre = [*setup.start.flat, *np.zeros(angles), *force, setup.mechanism.hip_height, *np.zeros(8)]
        self.size = np.array(
            [
                *[ANGLE_AMPLITUDE] * angles,
                *VELOCITY_AMPLITUDE * fastest.ravel(),
                *FORCE_AMPLITUDE * force,
                *BODY_AMPLITUDES * body,
            ]
        )
        self.centre = np.array(centre[: len(self.size)])
        self.drift = np.zeros_like(self.centre)
        if body:
            self.drift[-3] = setup.config.sampling_period * setup.config.body_speed
        return self._measure()

    def step(self, torque: Array, drive: Drive | None = None) -> Measurement:
        """Record the command and return the next signals."""
        sent = [torque] if drive is None else [drive.q, drive.dq, torque, drive.stiffness, drive.damping]
        self.commands.append(np.concatenate(sent, axis=None))
        return self._measure()

    @property
    def burst(self) -> int:
        """First step of the larger signals, which last for an eighth of a cycle."""
        return 5 * self.period // 2

    def _measure(self) -> Measurement:
        """Draw the signals of the next step."""
        step = len(self.commands)
        draws = []
        for _ in self.centre:
            self.random = (self.random * FACTOR + INCREMENT) % 2**64
            draws.append((self.random >> 11) * 2.0**-53)
        scale = 1.0 if step < self.period else BURST if 0 <= step - self.burst < self.period // 8 else 0.5
        signals = self.centre + self.drift * step + scale * self.size * (2.0 * np.array(draws) - 1.0)
        legs, joints = self.mechanism.shape
        q, dq = signals[: 2 * legs * joints].reshape(2, legs, joints)
        force, body = np.split(signals[2 * legs * joints :], [legs])
        pose, rate, travel = body.reshape(3, 3) if len(body) else np.zeros((3, 3))
        return Measurement(q, dq, *compute_feet(self.mechanism, q, dq), force, pose, rate, travel)


def describe_law(run: Run) -> dict[str, Any]:
    """Return the variables of the law of a run for the templates of :func:`cmacexp.addons.export.c_code.write_c`.

    Raises BadInput if the C code does not support a component of the run, and BadRun.
    """
    require_exportable(run)
    config = read_final_config(run)
    learnt = read_learnt(run)
    _require_supported(run, config)
    config = replace(
        config.nominal,
        cycles=CYCLES,
        learning=replace(config.learning, start_from=None if learnt is None else str(run.folder)),
        actuator=replace(config.actuator, delay=0, lag=0.0),  # the motors have these
    )
    player = Player()
    scenario = make_scenario(config, learnt, plant=player, sensors=PerfectSensors(ComponentConfig()))
    law = _describe(scenario) | {"guard": _describe_guard(scenario)}
    for _ in run_cycles(scenario):
        pass
    end = scenario.end
    if end.status != Status.COMPLETED:
        raise BadRun(f"{run.folder}: its law ends {end.status} in the check of the C code ({end.cause})")
    params: Any = scenario.feedforward.params  # type: ignore[attr-defined]  # a network
    return law | {
        "centre": player.centre,
        "drift": player.drift,
        "size": player.size,
        "burst": player.burst,
        "grown": BURST,
        "cycles": CYCLES,
        "seed": SEED,
        "multiplier_64": FACTOR,
        "increment_64": INCREMENT,
        "sums": [checksum(cycle) for cycle in np.array(player.commands).reshape(CYCLES, -1)],
        "walked_sum": checksum(keep_rows(params, list_path_rows(params)).weights),
        "events": len(end.guard),
    }


def _require_supported(run: Run, config: Config) -> None:
    """Raise BadInput unless the C code supports all components of the run."""
    learning = config.learning
    lead = run.config["learning"]["lead"]
    controller = config.controller
    resets = isinstance(controller, HybridController.Config) and controller.lead_reset
    refused = {
        "machine.kind": (
            config.machine.kind,
            isinstance(config.machine, PointMassMachine),
            "must be leg, quadruped or robot",
        ),
        "force_control.load_sharing": (
            config.force_control.load_sharing,
            config.force_control.load_sharing == ADAPTIVE,
            "must be dynamic or static: C makes no plan anew",
        ),
        "plausibility.enabled": (True, config.plausibility.enabled, "must be false: C checks no force sensor"),
        "force_control.switch": (
            config.force_control.switch,
            config.force_control.has_force_in_transfer,
            "must be plan: C has no force terms in transfer",
        ),
        "controller.lead_reset": (True, resets, "must be false: C keeps the states of the LEAD"),
        "cmac.weight_type": (config.cmac.weight_type, config.cmac.weight_step > 0.0, "must be float64"),
        "learning.guard": (learning.guard, learning.guard == REFINE, "must be freeze or none"),
        "learning.lead": (lead, lead == ESTIMATE, f"must be auto or a number, as {learning.lead}, its last estimate"),
        **{
            f"sensors.{name}.lag": (signal.lag, signal.lag, "must be 0: C filters no signal")
            for name, signal in (config.sensors.signals if isinstance(config.sensors, ChannelsConfig) else {}).items()
        },
    }
    for key, (value, is_refused, allowed) in refused.items():
        require(not is_refused, key, value, f"{allowed}; run it again so for --law")


def _describe(scenario: Scenario) -> dict[str, Any]:
    """Return tables and constants of plan and controller."""
    setup = scenario.setup
    plan = setup.plan
    mechanism = setup.mechanism
    control: Any = scenario.controller.params  # type: ignore[attr-defined]  # of hybrid or drives
    drives = isinstance(control, DriveParams)
    body = has_body(mechanism)
    chains = mechanism.chains is not None
    method = next(name for name, number in METHODS.items() if drives or number == control.method)
    columns = {
        "X": plan.reference.position[..., X],
        "Y": plan.reference.position[..., Y],
        "VX": plan.reference.velocity[..., X],
        "VY": plan.reference.velocity[..., Y],
        "ADDED": plan.reference.force_added,
        **({"DESIRED": plan.reference.force_desired} if drives else {}),
        **({"F_REFERENCE": plan.reference.force_reference} if method == "explicit" else {}),
        **({"Z": plan.reference.position[..., Z], "VZ": plan.reference.velocity[..., Z]} if chains else {}),
    }
    reference = np.nan_to_num(np.stack([*columns.values()], axis=-1))  # NaN marks values that no method uses
    stages = 1 if (reference[BEFORE] == reference[ACTING]).all() else 2
    config = setup.config
    actuator = new_actuator(config.actuator, config.sampling_period, len(mechanism.legs), mechanism.torque_limits)
    limits = np.minimum(actuator.limit, sys.float_info.max)
    delayed = drives and bool(control.behind.any())
    posture = body and not drives and bool(control.posture_gain or control.posture_rate_gain)
    return {
        "control": control,
        "mechanism": mechanism,
        "drives": drives,
        "body": body,
        "chains": chains,
        "method": method,
        "posture": posture,
        "rates": posture and control.posture_rate_gain != 0.0,
        "columns": [*columns],
        "stages": stages,
        "reference": reference[-stages:].reshape(-1, *reference.shape[2:]),
        "support": plan.support,
        "start": setup.start,
        "start_step": plan.start_step,
        "angles": control.angles if drives else None,
        "behind": {f"{name}_behind": control.behind[i] for i, name in enumerate(("angle", "rate"))}
        if delayed
        else {},
        "lengths": mechanism.legs[:, :2],
        "limits": limits,
        "limited": bool((limits < sys.float_info.max).any()),
        "change": actuator.change if actuator.change < np.inf else 0.0,
        "steering": control.steering,
        "pushed": steering.PUSHED,
        "ease": min(1.0, config.sampling_period / steering.EASE),
        "newton_steps": NEWTON_STEPS,
        "sine": sine,
    }


def _describe_guard(scenario: Scenario) -> dict[str, Any] | None:
    """Return initial state and constants of the guard of learning; None if there is no guard."""
    guard = make_guard(scenario)
    if guard is None:
        return None
    return {
        "window": TREND_WINDOW,
        "significant": SIGNIFICANT,
        "settling": of_guard.SETTLING,
        "tiny": of_guard.TINY,
        "drift_ratio": of_guard.DRIFT_RATIO,
        "better": of_guard.BETTER,
        "highest_effort": of_guard.HIGHEST_EFFORT,
        "still_falls": of_guard.STILL_FALLS,
        "chatters": of_guard.CHATTERS * of_guard.CHATTERS * guard.planned_motion,
        "highest": [ratio**2 for ratio in HIGHEST],
        "lever": guard.state.lever,
        "limits": guard.state.limits,
        "phase": int(guard.phase),
        "infers": int(guard.state.infers[0]),
    }
