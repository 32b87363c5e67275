"""The whole control law of a stored run for C: plan, controller, limits, guard, and what checks them.

The check plays signals by chance to the loop of the project, as its plant, and sums the commands that answer them.
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
from cmacexp.control import steering
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
from cmacexp.models.trend import SIGNIFICANT, WINDOW
from cmacexp.planning import Setup
from cmacexp.planning.reference import ACTING, BEFORE, X, Y, Z
from cmacexp.plants import Measurement
from cmacexp.protocols import Drive
from cmacexp.sensors import PerfectSensors
from cmacexp.sensors.config import ChannelsConfig
from cmacexp.typing import Array, Status

CYCLES = 4
"""Cycles of the check."""
SEED, FACTOR, INCREMENT = 1997, 6364136223846793005, 1442695040888963407
"""Seed and constants of a linear congruential generator of 64 bits (Knuth, MMIX)."""
ANGLE, RATE, PRESSED = 0.05, 0.5, 0.3
"""Sizes of the signals by chance: of angles, rad, of velocities over the largest planned ones, and of forces over the
mean of the planned ones."""
FASTEST = 10.0
"""Largest planned velocity that counts, rad/s: sixteen times half of it is below the limit of the loop."""
OF_A_BODY = (0.002, 0.01, 0.01, 0.05, 0.1, 0.1, 0.002, 0.002, 0.002)
"""Sizes of the signals by chance of height, pitch and roll, their rates, place and heading: m, rad, s."""
BURST = 16.0
"""Factor by which signals grow in a part of the third cycle: enough to alarm a guard, and for no body to fall."""


def compute_feet(mechanism: Mechanism, q: Array, dq: Array) -> tuple[Array, Array]:
    """Place and velocity of the feet (L, axes), m, m/s, that follow from joints (L, J), rad, rad/s, as C has them."""
    kinematics = np.zeros((len(q), KINEMATICS_FIELDS[mechanism.axes]))
    foot, velocity = np.zeros_like(q), np.zeros_like(q)
    update_kinematics(mechanism, q, kinematics)
    for i in range(len(q)):
        compute_foot_position(mechanism, i, kinematics, foot)
        compute_foot_velocity(mechanism, i, kinematics, dq, velocity)
    return foot, velocity


class Player:
    """A plant that plays signals by chance around the start of a plan, and keeps the commands that answer them.

    In the third cycle they grow for a while, which alarms a guard.

    Attributes:
        centre: (signals,) their mean, in the order of C; their unit as the next two.
        drift: what is added to it in each step.
        size: largest distance from it; after the first cycle half of that.
        commands: (numbers,) of every step, in the order of C.
    """

    takes_drives = True

    def __init__(self) -> None:
        self.commands: list[Array] = []
        self.chance = SEED

    def reset(self, setup: Setup) -> Measurement:
        """The signals of the first step."""
        self.mechanism, self.period = setup.mechanism, len(setup.plan.support)
        legs, joints = setup.mechanism.shape
        force, angles, body = setup.plan.force_desired.mean(axis=0), legs * joints, has_body(setup.mechanism)
        fastest = np.abs(setup.plan.joints.velocity).max(axis=0)
        centre = [*setup.start.flat, *np.zeros(angles), *force, setup.mechanism.hip_height, *np.zeros(8)]
        self.size = np.array(
            [*[ANGLE] * angles, *RATE * np.minimum(fastest, FASTEST).ravel(), *PRESSED * force, *OF_A_BODY * body]
        )
        self.centre = np.array(centre[: len(self.size)])
        self.drift = np.zeros_like(self.centre)
        if body:
            self.drift[-3] = setup.config.sampling_period * setup.config.body_speed
        return self._measure()

    def step(self, torque: Array, drive: Drive | None = None) -> Measurement:
        """Keep the command; the next signals."""
        sent = [torque] if drive is None else [drive.q, drive.dq, torque, drive.stiffness, drive.damping]
        self.commands.append(np.concatenate(sent, axis=None))
        return self._measure()

    @property
    def burst(self) -> int:
        """Step in which the signals grow, for an eighth of a cycle."""
        return 5 * self.period // 2

    def _measure(self) -> Measurement:
        step, draws = len(self.commands), []
        for _ in self.centre:
            self.chance = (self.chance * FACTOR + INCREMENT) % 2**64
            draws.append((self.chance >> 11) * 2.0**-53)
        scale = 1.0 if step < self.period else BURST if 0 <= step - self.burst < self.period // 8 else 0.5
        signals = self.centre + self.drift * step + scale * self.size * (2.0 * np.array(draws) - 1.0)
        legs, joints = self.mechanism.shape
        q, dq = signals[: 2 * legs * joints].reshape(2, legs, joints)
        force, body = np.split(signals[2 * legs * joints :], [legs])
        pose, rate, travel = body.reshape(3, 3) if len(body) else np.zeros((3, 3))
        return Measurement(q, dq, *compute_feet(self.mechanism, q, dq), force, pose, rate, travel)


def describe_law(run: Run) -> dict[str, Any]:
    """What the templates of :func:`cmacexp.addons.export.c_code.write_c` say of the law of a run.

    Raises BadInput if the run has anything that the C code would lack, and BadRun.
    """
    require_exportable(run)
    config, learnt = read_final_config(run), read_learnt(run)
    _require_carried(run, config)
    config = replace(
        config.nominal,
        cycles=CYCLES,
        learning=replace(config.learning, start_from=None if learnt is None else str(run.folder)),
        actuator=replace(config.actuator, delay=0, lag=0.0),  # which motors have by themselves
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
    commands = np.array(player.commands).reshape(CYCLES, -1)
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
        "sums": [checksum(each) for each in commands],
        "walked_sum": checksum(keep_rows(params, list_path_rows(params)).weights),
        "events": len(end.guard),
    }


def _require_carried(run: Run, config: Config) -> None:
    """Require that the C code lacks nothing of the run; raises BadInput."""
    learning = config.learning
    lead = run.config["learning"]["lead"]
    sharing = config.force_control.load_sharing
    refused = {
        "machine.kind": (
            config.machine.kind,
            isinstance(config.machine, PointMassMachine),
            "must be leg, quadruped or robot",
        ),
        "force_control.load_sharing": (
            sharing,
            sharing == ADAPTIVE,
            "must be dynamic or static: C makes no plan anew",
        ),
        "plausibility.enabled": (True, config.plausibility.enabled, "must be false: C checks no force sensor"),
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
    """Tables and constants of plan and controller."""
    setup = scenario.setup
    config, plan, mechanism = setup.config, setup.plan, setup.mechanism
    control: Any = scenario.controller.params  # type: ignore[attr-defined]  # of hybrid or drives
    drives, body, chains = isinstance(control, DriveParams), has_body(mechanism), mechanism.chains is not None
    method = next(name for name, number in METHODS.items() if drives or number == control.method)
    place, rate = (np.moveaxis(values, -1, 0) for values in (plan.reference.position, plan.reference.velocity))
    columns = {
        **{"X": place[X], "Y": place[Y], "VX": rate[X], "VY": rate[Y], "ADDED": plan.reference.force_added},
        **({"DESIRED": plan.reference.force_desired} if drives else {}),
        **({"F_REFERENCE": plan.reference.force_reference} if method == "explicit" else {}),
        **({"Z": place[Z], "VZ": rate[Z]} if chains else {}),
    }
    reference = np.nan_to_num(np.stack([*columns.values()], axis=-1))  # of which no method uses what is NaN
    stages = 1 if (reference[BEFORE] == reference[ACTING]).all() else 2
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
    """State and constants of the guard of learning at the start; None: nothing guards it."""
    guard = make_guard(scenario)
    if guard is None:
        return None
    return {
        "window": WINDOW,
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
