"""Learners that predict the torque of the next stroke from earlier ones: tables, networks, models, and their sums.

Their inputs are available before the stroke: commands, phase, speed, a model. They learn a stroke after its end. A
method of a user is a class without arguments, with ``fit(strokes)`` and ``predict(stroke)``.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from cmacexp.addons.gap.problem import KNOTS, Problem
from cmacexp.addons.gap.signals import Signals, differentiate, low_pass
from cmacexp.cmac.network import Cmac
from cmacexp.models.joint import OWN
from cmacexp.typing import Array, Counts

RATE = 0.2
"""Learning rate of the CMACs."""
GAIN = 0.7
"""Learning gain of iterative learning control (ILC)."""
HARMONICS = 25
"""Number of harmonics of a stroke that the filter of ILC passes."""
CHANGE, ROUGH = 0.4, 1e-3
"""Weights of norm-optimal ILC (Amann, Owens & Rogers 1996), which minimises |w - u|^2 + CHANGE |u - u_before|^2 +
ROUGH |n u|^2 in harmonic n of the torque u, where w is the torque of the last stroke."""
BUMPS = 40
"""Number of radial basis functions over a stroke."""
FEATURES = 300
"""Number of random Fourier features."""
RIDGE = 0.3
"""Inverse variance of the prior of linear weights, (N m)^-2."""
GRID = np.arange(400) / 400
"""Phases of a stroke at which ILC stores a torque."""
EPOCHS = 60
"""Passes of the perceptron through all samples after each stroke."""
PLACED = ("stroke before", "CMAC over phase", "CMAC over angles and velocities")
"""Tables that are combined with a model, and that are applied to the identified plant."""


class Learner(Protocol):
    """A predictor of the torque of a stroke, which learns it after its end; strokes come in order, from the first."""

    def predict(self, rows: slice) -> Array:
        """Predict the torque (rows, J) of the stroke in ``rows`` of the log, N m."""

    def learn(self, rows: slice, torque: Array) -> None:
        """Learn the ``torque`` (rows, J) of drives and feedforward together in a completed stroke, N m."""


Maker = Callable[[], Learner]
"""A constructor of a learner."""


def predict_all(learner: Learner, signals: Signals, last: int | None = None, first: int = 1) -> Array:
    """Predict the torque (n, J) of the strokes from ``first`` on, N m, each from the strokes before it.

    After stroke ``last`` nothing is learnt; None: every stroke is learnt.
    """
    predicted = np.zeros_like(signals.torque)
    for stroke in range(first, signals.count + 1):
        rows = signals.rows(stroke)
        predicted[rows] = learner.predict(rows)
        if last is None or stroke <= last:
            learner.learn(rows, signals.torque[rows])
    return predicted


@dataclass
class Fixed:
    """A predictor with a fixed torque (n, J), N m, which learns nothing."""

    torque: Array

    def predict(self, rows: slice) -> Array:
        """Return the fixed torque in these rows."""
        return self.torque[rows]

    def learn(self, rows: slice, torque: Array) -> None:
        """Do nothing."""


class Iterative:
    """Iterative learning control over the phase: u <- Q (u + gain e) (Bristow, Tharayil & Alleyne 2006).

    The filter Q passes the first ``harmonics``, by default all, and divides each harmonic n by 1 + ``rough`` n^2.
    With gain 1 and all harmonics the torque of the stroke before is repeated.
    """

    def __init__(self, signals: Signals, gain: float = 1.0, harmonics: float = np.inf, rough: float = 0.0):
        self.phase = signals.phase
        self.gain = gain
        self.torque = np.zeros((GRID.size, signals.torque.shape[1]))
        number = np.arange(GRID.size // 2 + 1)[:, None]
        self.passes = (number <= harmonics) / (1.0 + rough * number**2)

    def predict(self, rows: slice) -> Array:
        """Interpolate the stored torque at the phases of the stroke."""
        return np.stack([np.interp(self.phase[rows], GRID, stored, period=1.0) for stored in self.torque.T], axis=1)

    def learn(self, rows: slice, torque: Array) -> None:
        """Correct the stored torque by the prediction error of the stroke."""
        error = torque - self.predict(rows)
        at_grid = np.stack([np.interp(GRID, self.phase[rows], joint_error) for joint_error in error.T], axis=1)
        passed = np.fft.rfft(self.torque + self.gain * at_grid, axis=0) * self.passes
        self.torque = np.fft.irfft(passed, GRID.size, axis=0)


class CmacLearner:
    """One CMAC for each block of joints, over ``inputs`` (n, m) of the block, trained sample by sample."""

    def __init__(self, blocks: Sequence[Counts], inputs: Sequence[Array]):
        self.blocks = blocks
        self.inputs = inputs
        self.cmacs = [
            Cmac(x.min(axis=0) - 1e-6, x.max(axis=0) + 1e-6, len(block), layers=16, cells=9)
            for block, x in zip(blocks, inputs, strict=True)
        ]

    def predict(self, rows: slice) -> Array:
        """Return the outputs of the networks in the order of the joints."""
        outputs = [cmac.predict(x[rows]) for cmac, x in zip(self.cmacs, self.inputs, strict=True)]
        return np.concatenate(outputs, axis=1)[:, np.argsort(np.concatenate(self.blocks))]

    def learn(self, rows: slice, torque: Array) -> None:
        """Train each network once with every sample of the stroke, in order."""
        for block, cmac, inputs in zip(self.blocks, self.cmacs, self.inputs, strict=True):
            for x, target in zip(inputs[rows], torque[:, block], strict=True):
                cmac.update(x, target - cmac.predict(x), RATE)


class Linear:
    """Recursive least squares over features (n, 1, F) that all joints share, or (n, J, F) of each joint.

    The weights have the mean ``prior`` (F,) and the inverse variance ``ridge`` before the first stroke.
    """

    def __init__(self, signals: Signals, features: Array, prior: Array | float = 0.0, ridge: float = RIDGE):
        joints = signals.torque.shape[1]
        size = features.shape[2]
        self.features = np.broadcast_to(features, (len(features), joints, size))
        self.information = np.stack([np.eye(size) * ridge] * joints)
        self.moment = np.zeros((joints, size)) + ridge * prior

    def predict(self, rows: slice) -> Array:
        """Return the outputs with the current weights."""
        weights = np.linalg.solve(self.information, self.moment[..., None])[..., 0]
        return np.einsum("kjf,jf->kj", self.features[rows], weights)

    def learn(self, rows: slice, torque: Array) -> None:
        """Add the samples of the stroke to the normal equations."""
        features = self.features[rows].transpose(1, 2, 0)
        self.information += features @ features.transpose(0, 2, 1)
        self.moment += np.einsum("jfk,kj->jf", features, torque)


class Perceptron:
    """A multilayer perceptron over features (n, F), trained on all strokes so far (scikit-learn)."""

    def __init__(self, features: Array, joints: int):
        from sklearn.neural_network import MLPRegressor

        self.features = features
        self.torque = np.zeros((0, joints))
        # "adam" counts its passes from the first on; each training goes EPOCHS further
        self.network = MLPRegressor(
            hidden_layer_sizes=(64,), max_iter=EPOCHS, random_state=0, tol=0.0, warm_start=True
        )

    def predict(self, rows: slice) -> Array:
        """Return the outputs of the network, zero in the first stroke."""
        shape = (rows.stop - rows.start, self.torque.shape[1])
        return self.network.predict(self.features[rows]).reshape(shape) if self.torque.size else np.zeros(shape)

    def learn(self, rows: slice, torque: Array) -> None:
        """Train on the samples of all strokes so far."""
        import warnings

        self.torque = np.concatenate([self.torque, torque])
        with warnings.catch_warnings(action="ignore"):  # of a network that has not converged
            self.network.fit(self.features[rows.stop - len(self.torque) : rows.stop], self.torque)


@dataclass
class Both:
    """The sum of a model and a learner of the torque that the model lacks; the model ignores the learner."""

    model: Learner
    residual: Learner

    def predict(self, rows: slice) -> Array:
        """Return the sum of both predictions."""
        return self.model.predict(rows) + self.residual.predict(rows)

    def learn(self, rows: slice, torque: Array) -> None:
        """Train the learner with the torque that the model leaves, then the model with all of it."""
        self.residual.learn(rows, torque - self.model.predict(rows))
        self.model.learn(rows, torque)


def make_tables(problem: Problem) -> Mapping[str, Maker]:
    """Return constructors of learners that need no model, by name.

    Those over the phase are included only if the strokes repeat one motion.
    """
    signals = problem.signals
    blocks = problem.machine.blocks
    plan = low_pass(signals.command, signals.log.period)
    rate = differentiate(plan, signals.log.period)
    by_state = [np.concatenate([plan[:, b], rate[:, b]], axis=1) for b in blocks]
    makers: dict[str, Maker] = {"CMAC over angles and velocities": lambda: CmacLearner(blocks, by_state)}
    if signals.repeats:
        turn = np.stack([np.cos(2.0 * np.pi * signals.phase), np.sin(2.0 * np.pi * signals.phase)], axis=1)
        with_speed = np.column_stack([turn, signals.speed / signals.speed.max()])
        apart = np.abs((signals.phase[:, None] - np.arange(BUMPS) / BUMPS + 0.5) % 1.0 - 0.5)
        bumps = np.exp(-0.5 * (apart * BUMPS / 1.2) ** 2)
        bumps /= bumps.sum(axis=1, keepdims=True)
        makers |= {
            "stroke before": lambda: Iterative(signals),
            "ILC": lambda: Iterative(signals, GAIN, HARMONICS),
            "norm-optimal ILC": lambda: Iterative(signals, 1.0 / (1.0 + CHANGE), rough=ROUGH / (1.0 + CHANGE)),
            "CMAC over phase": lambda: CmacLearner(blocks, [turn] * len(blocks)),
            "CMAC over phase and speed": lambda: CmacLearner(blocks, [with_speed] * len(blocks)),
            "RBF over phase": lambda: Linear(signals, bumps[:, None]),
        }
    return makers


def make_networks(problem: Problem, angle: Array, velocity: Array) -> Mapping[str, Maker]:
    """Return constructors of learners over the replayed motion of a model, by name.

    ``angle``, rad, and ``velocity``, rad/s, (n, J) are its response to the commands of the log.
    """
    signals = problem.signals
    period = signals.log.period
    motion = (angle, velocity, differentiate(low_pass(velocity, period, 20.0), period))
    features = np.concatenate(motion, axis=1)
    features = (features - features.mean(axis=0)) / (features.std(axis=0) + 1e-9)
    size = features.shape[1]
    random = np.random.default_rng(0)
    turns = features @ (random.normal(size=(size, FEATURES)) * 1.5 / np.sqrt(size))
    waves = np.sqrt(2.0 / FEATURES) * np.cos(turns + random.uniform(0.0, 2.0 * np.pi, FEATURES))
    fourier = np.concatenate([waves, 0.2 * features, np.ones((len(features), 1))], axis=1)
    joints = problem.make_regressors(KNOTS, motion)
    joints[..., 0] *= 0.1  # unit of the rotor inertia: 0.1 kg m^2, the standard deviation of its prior
    rigid = problem.machine.compute_torque(*motion, signals.log.orientation)
    regressor = np.concatenate([joints, rigid[..., None]], axis=-1)
    prior = np.append(np.zeros(OWN + KNOTS), 1.0)
    return {
        "random Fourier features": lambda: Linear(signals, fourier[:, None]),
        "regressor of the model": lambda: Linear(signals, regressor, prior, 1.0),
        "perceptron": lambda: Perceptron(features, signals.torque.shape[1]),
    }


def place_below(problem: Problem, name: str, torque: Array) -> Mapping[str, Maker]:
    """Return constructors of a fixed ``torque`` (n, J), N m, without and with each table of PLACED, by name."""
    fixed = Fixed(torque)
    return {name: lambda: fixed} | {
        f"{name} and {table}": lambda make=make: Both(fixed, make())  # type: ignore[misc]
        for table, make in make_tables(problem).items()
        if table in PLACED
    }


@dataclass(frozen=True)
class Stroke:
    """A stroke of a log, arrays (rows, J); measured values are None until the stroke is over."""

    period: float
    """Time between two rows, s."""
    phase: Array
    """(rows,), from 0 to 1."""
    command: Array
    """Commanded angles, rad."""
    command_rate: Array
    """Derivative of the commanded angles, rad/s."""
    angle: Array | None = None
    """Measured angles, rad."""
    torque: Array | None = None
    """Torque of the drives, N m, which the method predicts."""


@dataclass
class Entered:
    """A method of a user as a learner; it receives copies, and nothing measured of the stroke that it predicts.

    ``method.fit(strokes)`` is called after every stroke with all strokes so far; ``method.predict(stroke)`` returns
    the torque (rows, J) of the next stroke, N m.
    """

    signals: Signals
    method: Any
    strokes: list[Stroke] = field(default_factory=list)

    @cached_property
    def _rate(self) -> Array:
        """Derivative of the commands (n, J), rad/s."""
        return differentiate(self.signals.command, self.signals.log.period)

    def _cut(self, rows: slice) -> Stroke:
        signals = (self.signals.phase, self.signals.command, self._rate)
        return Stroke(self.signals.log.period, *(values[rows].copy() for values in signals))

    def predict(self, rows: slice) -> Array:
        """Return the prediction of the method; raise ValueError unless it is finite and (rows, J)."""
        predicted = np.asarray(self.method.predict(self._cut(rows)), dtype=float)
        if predicted.shape != (shape := self.signals.torque[rows].shape) or not np.isfinite(predicted).all():
            raise ValueError(
                f"the torque of stroke {self.signals.stroke[rows.start]} has shape {predicted.shape} or is not "
                f"finite: must be finite numbers of shape {shape}"
            )
        return predicted

    def learn(self, rows: slice, torque: Array) -> None:
        """Fit the method to all strokes so far, this one included."""
        self.strokes.append(replace(self._cut(rows), angle=self.signals.log.angle[rows].copy(), torque=torque.copy()))
        self.method.fit(list(self.strokes))
