"""Desired motion and force of the feet over one cycle: their phases, motion within reach, and share of the load.

Phases are counted in samples instead of seconds, so that an event is at the same sample in every cycle.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmacexp.config import Config
from cmacexp.config.gait import COSINE, PATTERNS, GaitConfig
from cmacexp.errors import BadInput
from cmacexp.jit.compiler import kernel, program, workload
from cmacexp.models.ground import depression_for
from cmacexp.models.leg import Leg, Pair, inverse_kinematics, joint_acceleration, joint_velocity, trigonometry
from cmacexp.models.mechanism import POINT_MASS, Mechanism, get_leg
from cmacexp.planning.body import BodyLoad
from cmacexp.planning.foot_path import VERTICAL, line, quintic
from cmacexp.planning.load_sharing import remove_pull, share_load
from cmacexp.planning.reference import Motion, X, Y
from cmacexp.typing import Array, Mask


class Timing(NamedTuple):
    """Phases over one cycle of N samples, for L legs; half-open: the touch-down sample is support."""

    support: Mask
    """(N, L): True in support."""
    sample: NDArray[np.int64]
    """(N, L): samples since the start of the phase."""
    transfer_samples: int
    support_samples: int

    @property
    def progress(self) -> Array:
        """(N, L): 0 at the start of the phase, 1 at its end."""
        length = np.where(self.support, self.support_samples, max(1, self.transfer_samples))
        return self.sample / length


def make_timing(gait: GaitConfig, samples: int) -> Timing:
    """Compute the phases of every leg over one cycle of ``samples`` samples."""
    support_samples = round(samples * gait.duty_factor)
    pattern = [(start + slope * gait.duty_factor) % 1.0 for start, slope in PATTERNS[gait.pattern].touch_downs]
    phases = pattern if gait.touch_down is None else gait.touch_down
    since = (np.arange(samples)[:, None] - np.rint(np.array(phases) * samples).astype(np.int64)) % samples
    support = since < support_samples
    return Timing(
        support, np.where(support, since, since - support_samples), samples - support_samples, support_samples
    )


def plan_horizontal(config: Config, timing: Timing) -> Motion:
    """Plan the motion (N, L) of every foot along x in the frame of its hip."""
    support_time = timing.support_samples * config.sampling_period
    transfer_time = timing.transfer_samples * config.sampling_period
    front, rear = config.gait.stroke / 2.0, -config.gait.stroke / 2.0
    motion = np.zeros((3, *timing.support.shape))
    support = timing.support
    motion[:, support] = line(front, rear, timing.progress[support], support_time)
    if timing.transfer_samples:
        speed = (rear - front) / support_time
        motion[:, ~support] = quintic(rear, front, speed, timing.progress[~support], transfer_time)
    return Motion(*motion)


def plan_load_fraction(config: Config, timing: Timing) -> tuple[Array, Array]:
    """Plan the fraction (N, L), 0 to 1, of its load that a foot takes along the gait's ramps, and its rate, 1/s."""
    gait = config.gait
    elapsed = np.asarray(timing.sample * config.sampling_period, dtype=float)
    remaining: Array = timing.support_samples * config.sampling_period - elapsed
    rising, rise_slope = make_ramp(gait.ramp, elapsed, gait.load_ramp)
    falling, fall_slope = make_ramp(gait.ramp, remaining, gait.unload_ramp)
    rise_rate = rise_slope * falling / (gait.load_ramp or 1.0)
    fall_rate = fall_slope * rising / (gait.unload_ramp or 1.0)
    return np.where(timing.support, rising * falling, 0.0), np.where(timing.support, rise_rate - fall_rate, 0.0)


def plan_force(config: Config, timing: Timing, feet: Array, load: BodyLoad) -> tuple[Array, Array]:
    """Plan the contact force (N, L), N, of every foot and its rate, N/s, along the ramps of the gait, if it has them.

    One leg presses with F_d; under a body the feet (N, L, 2), m, share the ``load``.
    """
    load_fraction, rate = plan_load_fraction(config, timing)
    force = config.force_control.desired_force
    if force is None:
        # The rate moves feet on soft ground only; under a quadruped the depression is a few mm.
        shared = share_load(load.force, feet - load.centre[:, None, :], timing.support, load_fraction)
        if config.force_control.load_sharing != "static":
            # A swinging leg may briefly move the load slightly outside the three feet that are down.
            shared = remove_pull(shared)
        return shared, np.zeros_like(load_fraction)
    return force * load_fraction, force * rate


def make_ramp(shape: str, elapsed: Array, duration: float) -> tuple[Array, Array]:
    """Compute the fraction of a load, 0 to 1, ``elapsed`` (N, L), s, after the start of a ramp of ``duration``, s.

    Also returns its rate times the duration.
    """
    within = elapsed < duration
    s = np.where(within, elapsed / (duration or 1.0), 1.0)
    if shape == COSINE:
        return 0.5 - 0.5 * np.cos(math.pi * s), np.where(within, 0.5 * math.pi * np.sin(math.pi * s), 0.0)
    return s, np.where(within, 1.0, 0.0)


def plan_motion(
    config: Config, timing: Timing, mechanism: Mechanism, forward: Motion, force: Array, rate: Array
) -> Motion:
    """Plan the motion of every foot from its motion ``forward`` (N, L) along x; in support it presses with ``force``.

    ``force`` (N, L) is in N, its ``rate`` (N, L) in N/s. Raises BadInput if the gait lifts the feet too little.
    """
    gait = config.gait
    stiffness = config.assumed_stiffness
    transfer_time = timing.transfer_samples * config.sampling_period
    motion = np.zeros((3, *timing.support.shape, mechanism.shape[1]))
    motion[..., X] = forward
    desired = Motion(*motion)
    progress = timing.progress
    for i in range(timing.support.shape[1]):
        support = timing.support[:, i]
        desired.position[support, i, Y] = mechanism.hip_height + depression_for(stiffness, force[support, i])
        desired.velocity[support, i, Y] = depression_for(stiffness, rate[support, i])
        if timing.transfer_samples:
            s = progress[~support, i]
            ends = [
                desired.position[support & (timing.sample[:, i] == k), i, Y][0]
                for k in (timing.support_samples - 1, 0)
            ]
            # This sum keeps the bits of an end at the planned depth.
            take_off, touch_down = (y + (gait.transfer_depth - 1.0) * (y - mechanism.hip_height) for y in ends)
            check_apex(config, touch_down - take_off)
            motion[:, ~support, i, Y] = VERTICAL[gait.vertical](take_off, touch_down, gait.lift, s, transfer_time)
    return desired


def check_apex(config: Config, gap: float) -> None:
    """Check that a single cubic has its only extremum at mid transfer; raise BadInput otherwise.

    ``gap`` is the depth of the touch-down point below the take-off point, m; they differ if the foot presses
    differently at both.
    """
    gait = config.gait
    if gait.vertical == "cubic" and abs(gap) > 1e-12 and gait.lift < 1.25 * abs(gap):
        depth = gait.transfer_depth  # over the depression, so that the ground gives way by the rest
        require_firm(config, abs(gap) / depth, gait.lift / 1.25 / depth)
        allowed = (
            f"must be at least {1.25 * abs(gap):.6g} m for one cubic between ends {abs(gap):.3g} m apart in height; "
            "or use gait.vertical=two_cubics"
        )
        raise BadInput("gait.lift", gait.lift, allowed)


def plan_joints(mechanism: Mechanism, desired: Motion) -> Motion:
    """Plan the joint motion for the ``desired`` motion of the feet; for a point mass both are the same."""
    joints = Motion(*np.array(desired))
    if mechanism.kind != POINT_MASS:
        with workload(joints.position[..., X].size):  # compiling pays off for many runs only
            _plan_samples_now(mechanism, desired, joints)
    return joints


@kernel
def _plan_sample(leg: Leg, foot: Pair, velocity: Pair, acceleration: Pair) -> tuple[Pair, Pair, Pair]:
    """Compute angles, rad, velocities, rad/s, and accelerations, rad/s^2, of the joints of a leg in one sample.

    ``foot`` (2,), m, ``velocity``, m/s, and ``acceleration``, m/s^2, are the motion of the foot.
    """
    q1, q2 = inverse_kinematics(leg, foot[0], foot[1])
    trig = trigonometry(q1, q2)
    dq1, dq2 = joint_velocity(leg, trig, velocity[0], velocity[1])
    return (q1, q2), (dq1, dq2), joint_acceleration(leg, trig, dq1, dq2, acceleration[0], acceleration[1])


@kernel
def _plan_samples(mechanism: Mechanism, desired: Motion, joints: Motion) -> None:
    """Fill the motion of the ``joints`` of planar legs, see :func:`plan_joints`."""
    for i in range(mechanism.legs.shape[0]):
        leg = get_leg(mechanism, i)
        for k in range(desired.position.shape[0]):
            angle, rate, change = _plan_sample(
                leg, desired.position[k, i], desired.velocity[k, i], desired.acceleration[k, i]
            )
            joints.position[k, i, 0], joints.position[k, i, 1] = angle
            joints.velocity[k, i, 0], joints.velocity[k, i, 1] = rate
            joints.acceleration[k, i, 0], joints.acceleration[k, i, 1] = change


def _plan_samples_plainly(mechanism: Mechanism, desired: Motion, joints: Motion) -> None:
    """Fill the same as :func:`_plan_samples` in plain Python, the floats of which are faster than NumPy's."""
    for i in range(mechanism.shape[0]):
        leg = Leg(*mechanism.legs[i].tolist())
        rows = zip(*(values[:, i].tolist() for values in desired), strict=True)
        planned = np.array([_plan_sample(leg, *row) for row in rows]).swapaxes(0, 1)
        joints.position[:, i], joints.velocity[:, i], joints.acceleration[:, i] = planned


_plan_samples_now = program(_plan_samples, _plan_samples_plainly)


SOFT = 0.4
"""Depression of the ground, over the height of the hips, above which it is the reason for a path out of reach."""
STRAIGHT = 1.0 - 1e-6
"""Largest distance of the foot from the hip over the length of the leg: a straight leg cannot move along itself."""
FOLDED = 1e-3
"""Least distance of the foot from its position with folded links, and below the hip, m."""


def require_firm(config: Config, depression: float, room: float) -> None:
    """Raise BadInput for the stiffness of the ground if it is the reason why a path is out of reach.

    The ground gives way by ``depression``, m, under the desired force; up to ``room``, m, the path is within reach.
    """
    if depression <= SOFT * config.machine.hip_height or room <= 1e-6:
        return
    key = "assumed_stiffness" if config.terrain.assumed_stiffness is not None else "stiffness"
    softest = config.assumed_stiffness * depression / room
    allowed = f"gives way by {depression:.3g} m under the desired force, further than the legs reach"
    allowed = f"{allowed}; must be above {softest:.4g} N/m, or the desired force smaller"
    raise BadInput(f"terrain.{key}", config.assumed_stiffness, allowed)


def _round_down(value: float) -> str:
    """Format ``value`` with four digits, rounded towards minus infinity, so that the printed limit is valid."""
    scale = 10.0 ** (3 - math.floor(math.log10(abs(value)))) if value else 1.0
    return f"{math.floor(value * scale) / scale:.10g}"


def _check_far(config: Config, mechanism: Mechanism, i: int, x: Array, y: Array, support: Mask) -> None:
    """Check that the path ``x``, ``y`` (N,), m, of leg ``i`` is within its full length; raise BadInput otherwise.

    ``support`` (N,) is True in support.
    """
    leg = get_leg(mechanism, i)
    reach = (leg.length_1 + leg.length_2) * STRAIGHT
    distance = np.hypot(x, y)
    k = int(np.argmax(distance))
    if distance[k] <= reach:
        return
    where = f"the foot of leg {i + 1} would be {distance[k]:.3f} m from its hip at sample {k}, "
    where += f"but it reaches only {reach:.3f} m"
    depth = config.gait.transfer_depth
    if depth > 1.0 and distance[support].max() <= reach:
        transfer = ~support
        missing = (y - np.sqrt(np.maximum(reach**2 - x**2, 0.0)))[transfer].max()
        deepest = depth * (1.0 - float(missing) / float(y[transfer].max() - mechanism.hip_height))
        raise BadInput("gait.transfer_depth", depth, f"{where}; must be at most {_round_down(max(1.0, deepest))}")
    ground = y[support].max()
    depression = ground - mechanism.hip_height
    if ground >= reach:
        require_firm(config, depression, reach - mechanism.hip_height)
        height = mechanism.hip_height - (ground - reach)
        allowed = (
            f"{where}, and the ground gives way by {depression:.3g} m under the desired force; "
            f"must be below {_round_down(height - 1e-9)} m"
        )
        raise BadInput("machine.hip_height", mechanism.hip_height, allowed)
    # Every x is proportional to the stroke.
    is_within = y < reach
    room = np.sqrt(reach**2 - y[is_within] ** 2) / np.maximum(np.abs(x[is_within]), 1e-12)
    widest = config.gait.stroke * float(room.min())
    raise BadInput("gait.stroke", config.gait.stroke, f"{where}; must be at most {_round_down(widest)} m")


def _check_near(config: Config, mechanism: Mechanism, i: int, x: Array, y: Array) -> None:
    """Check that the path (N,), m, of leg ``i`` is below its hip and outside the circle of the folded leg.

    Raises BadInput otherwise.
    """
    leg = get_leg(mechanism, i)
    nearest = float(abs(leg.length_1 - leg.length_2)) + FOLDED
    ground = float(y.max())
    if ground <= nearest:
        allowed = f"leg {i + 1} cannot fold that far: its foot comes no nearer to the hip than {nearest:.3f} m"
        raise BadInput("machine.hip_height", mechanism.hip_height, allowed)
    k = int(np.argmin(np.where(y < FOLDED, y, np.hypot(x, y))))
    if y[k] < FOLDED or np.hypot(x[k], y[k]) <= nearest:
        height = f"{abs(y[k]):.3f} m {'above' if y[k] < 0.0 else 'below'} its hip"
        allowed = (
            f"leg {i + 1} cannot lift its foot to {height}, as at sample {k}; "
            f"must be below {_round_down(ground - nearest)} m"
        )
        raise BadInput("gait.lift", config.gait.lift, allowed)


def check_reach(config: Config, mechanism: Mechanism, path: Array, support: Mask) -> None:
    """Check that the ``path`` (N, L, 2) of the feet, m, is within reach; else raise BadInput with a valid value.

    ``support`` (N, L) is True for feet that are down.
    """
    for i in range(mechanism.shape[0]):
        x, y = path[:, i].T
        _check_near(config, mechanism, i, x, y)
        _check_far(config, mechanism, i, x, y, support[:, i])
