"""The adaptive controller of Slotine & Li, as an example of entering a controller.

``controller._target_=pipelines.benchmark.methods.slotine_li.SlotineLi feedforward=none``
"""

import math
from dataclasses import dataclass

import numpy as np

from cmacexp.config import number
from cmacexp.control import Action, HybridController
from cmacexp.errors import BadInput
from cmacexp.feedforward import Feedforward
from cmacexp.models.leg import GRAVITY
from cmacexp.models.mechanism import CHAINS_UNDER_BODY, POINT_MASS
from cmacexp.planning.columns import ACTING, FORCE_ADDED, FORCE_DESIRED
from cmacexp.planning.setup import Reference, Setup
from cmacexp.plants.protocol import Measurement

Pair = tuple[float, float]


def motion_regressor(lengths: Pair, q: Pair, dq: Pair, rate: Pair, acceleration: Pair) -> tuple[Pair, Pair]:
    """Columns of Y in M ddq_r + C dq_r + g = Y (m1 + m2, m2), each (2,), N m/kg (Slotine & Li 1987).

    The masses sit at knee and foot, see :mod:`cmacexp.models.leg`. C is the one for which dM/dt - 2C is skew.

    Args:
        lengths: of thigh and shank, m.
        q: measured angles, rad.
        dq: measured velocities, rad/s.
        rate: dq_r, rad/s.
        acceleration: ddq_r, rad/s^2.
    """
    (l1, l2), (q1, q2), (dq1, dq2), (v1, v2), (a1, a2) = lengths, q, dq, rate, acceleration
    straight, bent = l1 * l2 * math.cos(q2), l1 * l2 * math.sin(q2)
    shank, both = l2 * l2, l2 * l2 + straight
    weight = GRAVITY * l2 * math.cos(q1 + q2)
    upper = both * a2 + (both + straight) * a1 - bent * (dq2 * v1 + (dq1 + dq2) * v2) - weight
    lower = both * a1 + shank * a2 + bent * dq1 * v1 - weight
    return (l1 * l1 * a1 - GRAVITY * l1 * math.cos(q1), 0.0), (upper, lower)


class SlotineLi(HybridController):
    """Y(q, dq, dq_r, ddq_r) a on top of hybrid control, a' = Gamma Y^T s (Slotine & Li 1987).

    s = dq_r - dq is the error of velocity plus lambda times that of position, of the measured feet; along the force
    of a supporting foot it is 0, since force control decides there: J^T F_d is added as it is. Hybrid control takes
    the place of K_D s. The parameters of each leg are m1 + m2 and m2, at first those of the nominal model. Gamma
    makes the gain a number: K_av J^T J over the power of each column, both as means over the plan, per cycle. The
    adaptive torque is the feedforward of the trace. A controller has no weights that a run could save: every run
    starts from the nominal model. Where the planned velocity jumps, ddq_d lacks the impulse, and the parameters are
    too large for it.
    """

    @dataclass
    class Config(HybridController.Config):
        """Speed of adaptation."""

        sliding: float = number("1/s", above=0, at_most=1e3, default=20.0, tuned=(3.0, 60.0))
        """lambda."""
        gain: float = number("", above=0, at_most=1e3, default=1.0, tuned=(0.1, 10.0))
        """Of the adaptation."""

    config: Config

    def reset(self, setup: Setup, feedforward: Feedforward) -> None:
        """Start with the nominal model.

        Raises:
            BadInput: the machine has no planar legs.
        """
        if setup.mechanism.kind in (POINT_MASS, CHAINS_UNDER_BODY):
            kind = setup.config.machine.kind
            raise BadInput("controller._target_", "SlotineLi", f"is for planar legs, not for machine.kind={kind}")
        super().reset(setup, feedforward)
        config, plan = setup.config, setup.plan
        self.start = (config.first_learning - 1) * config.steps_per_cycle
        self.values = plan.reference[ACTING]
        legs = setup.mechanism.legs
        self.lengths = [(float(leg[0]), float(leg[1])) for leg in legs]
        self.parameters = [[float(leg[2] + leg[3]), float(leg[3])] for leg in legs]
        self.rates = [self._rates(setup, i) for i in range(len(legs))]

    def _rates(self, setup: Setup, i: int) -> list[float]:
        """T_s Gamma of leg ``i``, from its planned motion."""
        joints, power, lever = setup.plan.joints[:, i].tolist(), np.zeros(2), 0.0
        for sample in joints:
            q, dq, ddq = (tuple(sample[n : n + 2]) for n in (0, 2, 4))
            power += [x * x + y * y for x, y in motion_regressor(self.lengths[i], q, dq, dq, ddq)]
            lever += sum(each * each for each in self._jacobian(i, q)) / 2.0
        factor = self.config.gain * self.config.velocity_gain * lever / len(joints)
        return [factor / each if each > 0.0 else 0.0 for each in power.tolist()]

    def _jacobian(self, i: int, q: Pair) -> tuple[float, float, float, float]:
        (l1, l2), first, both = self.lengths[i], q[0], q[0] + q[1]
        j12, j22 = -l2 * math.sin(both), l2 * math.cos(both)
        return j12 - l1 * math.sin(first), j12, j22 + l1 * math.cos(first), j22

    def act(self, reference: Reference, measurement: Measurement) -> Action:
        """Hybrid control; from the first cycle of learning on with the adaptive term."""
        if reference.step < self.start:
            return super().act(reference, measurement)
        values = self.values[reference.sample]
        action = super().act(reference._replace(values=values), measurement)
        slide = self.config.sliding
        away = reference.desired[:, :2] - measurement.foot
        apart = (reference.desired[:, 2:4] - measurement.velocity + slide * away).tolist()
        planned, q, dq = reference.joints.tolist(), measurement.q.tolist(), measurement.dq.tolist()
        pressed = (values[:, FORCE_DESIRED] - values[:, FORCE_ADDED]).tolist()
        adaptive = []
        for i, (x, y) in enumerate(apart):
            along_y = 0.0 if reference.support[i] else y
            adaptive.append(self._adapt(i, tuple(q[i]), tuple(dq[i]), planned[i], x, along_y, pressed[i]))
        return action._replace(feedforward=action.feedforward + adaptive)

    def _adapt(self, i: int, q: Pair, dq: Pair, planned: list[float], x: float, y: float, force: float) -> Pair:
        """Adapt the parameters of leg ``i`` to s of its foot, ``x`` and ``y`` in m/s; its torque, N m."""
        j11, j12, j21, j22 = self._jacobian(i, q)
        area, slide = j11 * j22 - j12 * j21, self.config.sliding
        s1, s2 = (j22 * x - j12 * y) / area, (j11 * y - j21 * x) / area
        rate = (dq[0] + s1, dq[1] + s2)
        acceleration = (planned[4] + slide * (planned[2] - dq[0]), planned[5] + slide * (planned[3] - dq[1]))
        columns = motion_regressor(self.lengths[i], q, dq, rate, acceleration)
        a, torque = self.parameters[i], [j21 * force, j22 * force]
        for n, (upper, lower) in enumerate(columns):
            a[n] += self.rates[i][n] * (upper * s1 + lower * s2)
            torque[0] += upper * a[n]
            torque[1] += lower * a[n]
        return torque[0], torque[1]
