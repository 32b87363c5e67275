"""One leg that learns to step and to press (Lin & Song 1997, section 5), written a second time from the paper.

Nothing of the project is imported: matrices instead of scalars, a memory without addresses, the paper's numbers.
Angles in rad, x forward and y down from the hip in m, torques in N m, forces in N.
"""

from dataclasses import dataclass, field

import numpy as np

PERIOD, HIP_HEIGHT, GRAVITY = 0.005, 0.5, 9.81
LENGTH, MASS = 0.35, 0.5
"""Of both links, and of the point masses at knee and foot."""
STROKE, LIFT, DUTY_FACTOR = 0.2, 0.16, 0.8
POSITION_GAIN, VELOCITY_GAIN = 100.0, 5.0
DESIRED_FORCE, ELASTICITY, ADMITTANCE = 1.0, 0.1, 0.1
OMEGA, ALPHA = 5.0, 10.0
LAYERS, ELEMENTS, RANGE_FACTOR, RATE = 32, 33, 5.0, 0.1953125


def knee_and_foot(q):
    """Both points, (2, 2)."""
    thigh = LENGTH * np.array([np.cos(q[0]), np.sin(q[0])])
    return thigh, thigh + LENGTH * np.array([np.cos(q.sum()), np.sin(q.sum())])


def jacobians(q):
    """Of knee and foot; each column is the lever of a joint turned by a quarter."""
    knee, foot = knee_and_foot(q)
    turned = np.array([[0.0, -1.0], [1.0, 0.0]])
    none = np.zeros(2)
    return np.column_stack([turned @ knee, none]), np.column_stack([turned @ foot, turned @ (foot - knee)])


def jacobian_rates(q, dq):
    """Their derivatives by time."""
    knee, foot = knee_and_foot(q)
    inward = -np.column_stack([knee * dq[0], np.zeros(2)])
    shank = -(foot - knee) * dq.sum()
    return inward, np.column_stack([-knee * dq[0] + shank, shank])


def pull_of_gravity(q, factors):
    """-G of eq. 23 with a factor for each of its terms, in the order in which they are printed."""
    a, b, c, d = np.array(factors) * MASS * GRAVITY * LENGTH
    return np.array([a * np.cos(q.sum()) + (b + c) * np.cos(q[0]), d * np.cos(q.sum())])


def acceleration(q, dq, torque, force, factors):
    """d'Alembert's principle for two point masses: M ddq + C dq + G = torque - J^T F."""
    pressed = np.array([0.0, force])
    maps, rates = jacobians(q), jacobian_rates(q, dq)
    inertia = sum(MASS * j.T @ j for j in maps)
    moved = sum(j.T @ (MASS * rate @ dq) for j, rate in zip(maps, rates, strict=True))
    return np.linalg.solve(inertia, torque - moved + pull_of_gravity(q, factors) - maps[1].T @ pressed)


def inverse_kinematics(foot):
    """The knee bends backwards."""
    distance = np.hypot(*foot)
    inner = np.arccos(distance / (2.0 * LENGTH))
    return np.array([np.arctan2(foot[1], foot[0]) + inner, -2.0 * inner])


class Plan:
    """A cycle of N samples: transfer first, then support."""

    def __init__(self, cycle_time, assumed_stiffness):
        self.samples = round(cycle_time / PERIOD)
        self.lift_time, support_time = (1.0 - DUTY_FACTOR) * cycle_time, DUTY_FACTOR * cycle_time
        self.speed = -STROKE / support_time
        self.depth = HIP_HEIGHT + DESIRED_FORCE / assumed_stiffness
        transfer = round((1.0 - DUTY_FACTOR) * self.samples)
        self.support = np.arange(self.samples) >= transfer
        motions = [self.swing(k * PERIOD) for k in range(transfer)]
        motions += [self.stand(k * PERIOD) for k in range(self.samples - transfer)]
        self.foot, self.velocity, acceleration = (np.array(part) for part in zip(*motions, strict=True))
        self.joints = np.array(
            [self.in_joints(*motion) for motion in zip(self.foot, self.velocity, acceleration, strict=True)]
        )
        literal = 1.0 / assumed_stiffness + 1.0 / POSITION_GAIN + ELASTICITY
        literal += VELOCITY_GAIN / POSITION_GAIN * ADMITTANCE
        self.fed_depth = HIP_HEIGHT + literal * DESIRED_FORCE

    def stand(self, time):
        return np.array([STROKE / 2.0 + self.speed * time, self.depth]), np.array([self.speed, 0.0]), np.zeros(2)

    def swing(self, time):
        """x goes by the quintic, found from its six conditions; y by a parabola, a cubic with equal ends."""
        end = self.lift_time
        power = np.arange(6)
        rows = [
            factor * at ** np.maximum(power - order, 0.0)
            for at in (0.0, end)
            for order, factor in enumerate((np.ones(6), power, power * (power - 1)))
        ]
        wanted = [-STROKE / 2.0, self.speed, 0.0, STROKE / 2.0, self.speed, 0.0]
        x = np.polynomial.Polynomial(np.linalg.solve(rows, wanted))
        y = np.polynomial.Polynomial([self.depth, -4.0 * LIFT / end, 4.0 * LIFT / end**2])
        return tuple(np.array([x.deriv(n)(time), y.deriv(n)(time)]) for n in range(3))

    @staticmethod
    def in_joints(foot, velocity, acceleration):
        """Angles, velocities and accelerations, (6,)."""
        q = inverse_kinematics(foot)
        jacobian = jacobians(q)[1]
        dq = np.linalg.solve(jacobian, velocity)
        return np.r_[q, dq, np.linalg.solve(jacobian, acceleration - jacobian_rates(q, dq)[1] @ dq)]


@dataclass
class Memory:
    """A CMAC whose cells have names instead of addresses: layer and block along each input."""

    low: np.ndarray
    width: np.ndarray
    weights: dict = field(default_factory=dict)

    @classmethod
    def over(cls, joints):
        low, high = joints.min(axis=0), joints.max(axis=0)
        width = RANGE_FACTOR * (high - low)
        return cls((low + high - width) / 2.0, width)

    def cells(self, point):
        quanta = np.floor((point - self.low) / self.width * (ELEMENTS - 1) * LAYERS).astype(int)
        return [(layer, *((quanta + layer) // LAYERS)) for layer in range(LAYERS)]

    def read(self, point):
        return sum(self.weights.get(cell, np.zeros(2)) for cell in self.cells(point))

    def teach(self, point, error):
        for cell in self.cells(point):
            self.weights[cell] = self.weights.get(cell, np.zeros(2)) + RATE / LAYERS * error


def simulate(
    cycle_time=3.0,
    cycles=2,
    start_cycle=1,
    lead=0,
    stiffness=10.0,
    assumed_stiffness=10.0,
    gravity=(1, 1, 1, 1),
    inputs=6,
):
    """(steps, 9): joint angles and velocities, contact force, feedback and feedforward torque of each step."""
    plan = Plan(cycle_time, assumed_stiffness)
    path = plan.joints[:, :inputs]
    memory = Memory.over(path)
    q, dq = plan.joints[0, :2].copy(), np.zeros(2)
    last_error = output = learning_error = np.zeros(2)
    rows = []

    def ground_force(angles):
        return stiffness * max(0.0, knee_and_foot(angles)[1][1] - HIP_HEIGHT)

    def slope(state, torque):
        return np.r_[state[2:], acceleration(state[:2], state[2:], torque, ground_force(state[:2]), gravity)]

    for step in range(cycles * plan.samples):
        k = step % plan.samples
        feedforward = np.zeros(2)
        if step >= (start_cycle - 1) * plan.samples:
            memory.teach(path[(k - 1 - lead) % plan.samples], learning_error)
            feedforward = memory.read(path[k])
        foot, jacobian, force = knee_and_foot(q)[1], jacobians(q)[1], ground_force(q)
        velocity = jacobian @ dq
        error = POSITION_GAIN * (plan.foot[k] - foot) + VELOCITY_GAIN * (plan.velocity[k] - velocity)
        if plan.support[k]:
            spring = POSITION_GAIN * (plan.fed_depth - foot[1] - ELASTICITY * force)
            error[1] = spring + VELOCITY_GAIN * (-velocity[1] - ADMITTANCE * force)
        # (1 + s/omega)/(1 + s/(alpha omega)) with s = 2/T_s (z - 1)/(z + 1)
        zero, pole = (2.0 / PERIOD / corner for corner in (OMEGA, ALPHA * OMEGA))
        output = ((1.0 + zero) * error + (1.0 - zero) * last_error - (1.0 - pole) * output) / (1.0 + pole)
        last_error, learning_error = error, jacobian.T @ output
        rows.append(np.r_[q, dq, force, learning_error, feedforward])
        torque, state, h = learning_error + feedforward, np.r_[q, dq], PERIOD
        k1 = slope(state, torque)
        k2 = slope(state + h / 2.0 * k1, torque)
        k3 = slope(state + h / 2.0 * k2, torque)
        k4 = slope(state + h * k3, torque)
        state = state + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        q, dq = state[:2], state[2:]
    return np.array(rows)
