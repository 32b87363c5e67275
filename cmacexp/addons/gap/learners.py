"""What predicts the torque of the next stroke from those before: tables, networks, models, and models below tables.

All that they use is known before the stroke: commands, phase, speed, a model. They learn a stroke after its end. A
method of a user is a class without arguments, with ``fit(strokes)`` and ``predict(stroke)``.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from cmacexp.addons.gap.identify import KNOTS, Problem
from cmacexp.addons.gap.signals import Signals, differentiate, low_pass
from cmacexp.cmac.network import Cmac
from cmacexp.models.joint import OWN
from cmacexp.typing import Array, Counts

RATE, LAYERS, CELLS = 0.2, 16, 9
"""Learning rate, layers and resolution elements of the CMACs."""
GAIN, HARMONICS = 0.7, 25
"""Learning gain of iterative learning, and the harmonics of a stroke that its filter passes."""
CHANGE, ROUGH = 0.4, 1e-3
"""Weights of norm-optimal iterative learning (Amann, Owens & Rogers 1996) of a plant whose feedback the torque
replaces: |w - u|^2 + CHANGE |u - u_before|^2 + ROUGH |n u|^2 is least in harmonic n, w the torque of the stroke."""
BUMPS, FEATURES = 40, 300
"""Radial basis functions over a stroke; random Fourier features."""
RIDGE = 0.3
"""Information of the prior of linear features, (N m)^-2."""
GRID = np.arange(400) / 400
"""Phases of a stroke at which iterative learning has a torque."""
HIDDEN, EPOCHS = 64, 60
"""Hidden units of the perceptron, and its passes through all samples after each stroke."""
PLACED = ("stroke before", "CMAC over phase", "CMAC over angles and velocities")
"""Tables that are placed above a model, and that act."""


class Learner(Protocol):
    """Predicts the torque of a stroke, and learns it after its end; strokes follow each other from the first on."""

    def predict(self, rows: slice) -> Array:
        """Torque (rows, J) of the stroke of these rows, N m."""

    def learn(self, rows: slice, torque: Array) -> None:
        """Learn what drives and feedforward supplied together in a stroke, (rows, J), N m."""


Maker = Callable[[], Learner]


def predict_all(learner: Learner, signals: Signals, last: int | None = None) -> Array:
    """Predictions (n, J) of all strokes, each from those before it; after stroke ``last`` nothing is learnt."""
    found = np.zeros_like(signals.torque)
    for stroke in range(1, signals.count + 1):
        rows = signals.rows(stroke)
        found[rows] = learner.predict(rows)
        if last is None or stroke <= last:
            learner.learn(rows, signals.torque[rows])
    return found


@dataclass
class Fixed:
    """A torque (n, J) that is known in advance; it learns nothing."""

    torque: Array

    def predict(self, rows: slice) -> Array:
        """The known torque."""
        return self.torque[rows]

    def learn(self, rows: slice, torque: Array) -> None:
        """Nothing."""


class Iterative:
    """Iterative learning over the phase: u <- Q (u + gain e) (Bristow, Tharayil & Alleyne 2006).

    Q passes the first ``harmonics``, all with infinity, and divides each harmonic n by 1 + ``rough`` n^2. With gain 1
    and all harmonics it repeats the torque of the stroke before.
    """

    def __init__(self, signals: Signals, gain: float = 1.0, harmonics: float = np.inf, rough: float = 0.0):
        self.phase, self.gain = signals.phase, gain
        self.torque = np.zeros((GRID.size, signals.torque.shape[1]))
        number = np.arange(GRID.size // 2 + 1)[:, None]
        self.passes = (number <= harmonics) / (1.0 + rough * number**2)

    def predict(self, rows: slice) -> Array:
        """The torque at the phases of the stroke."""
        return np.stack([np.interp(self.phase[rows], GRID, own, period=1.0) for own in self.torque.T], axis=1)

    def learn(self, rows: slice, torque: Array) -> None:
        """Correct the torque by the error of the stroke."""
        error = torque - self.predict(rows)
        at_grid = np.stack([np.interp(GRID, self.phase[rows], own) for own in error.T], axis=1)
        passed = np.fft.rfft(self.torque + self.gain * at_grid, axis=0) * self.passes
        self.torque = np.fft.irfft(passed, GRID.size, axis=0)


class CmacLearner:
    """A CMAC for each block of joints, over inputs (n, m) of the block, trained sample by sample."""

    def __init__(self, blocks: Sequence[Counts], inputs: Sequence[Array]):
        self.blocks, self.inputs = blocks, inputs
        self.cmacs = [
            Cmac(own.min(axis=0) - 1e-6, own.max(axis=0) + 1e-6, len(block), layers=LAYERS, cells=CELLS)
            for block, own in zip(blocks, inputs, strict=True)
        ]

    def predict(self, rows: slice) -> Array:
        """The outputs of the networks."""
        outputs = [cmac.predict(own[rows]) for cmac, own in zip(self.cmacs, self.inputs, strict=True)]
        return np.concatenate(outputs, axis=1)[:, np.argsort(np.concatenate(self.blocks))]

    def learn(self, rows: slice, torque: Array) -> None:
        """Train with every sample of the stroke."""
        for block, cmac, own in zip(self.blocks, self.cmacs, self.inputs, strict=True):
            for x, wanted in zip(own[rows], torque[:, block], strict=True):
                cmac.update(x, wanted - cmac.predict(x), RATE)


class Linear:
    """Recursive least squares over features (n, 1, F) of all joints, or (n, J, F) of each, from ``prior`` (F,) on."""

    def __init__(self, signals: Signals, features: Array, prior: Array | float = 0.0, ridge: float = RIDGE):
        joints, size = signals.torque.shape[1], features.shape[2]
        self.features = np.broadcast_to(features, (len(features), joints, size))
        self.information = np.stack([np.eye(size) * ridge] * joints)
        self.moment = np.zeros((joints, size)) + ridge * prior

    def predict(self, rows: slice) -> Array:
        """The outputs with the weights so far."""
        weights = np.linalg.solve(self.information, self.moment[..., None])[..., 0]
        return np.einsum("kjf,jf->kj", self.features[rows], weights)

    def learn(self, rows: slice, torque: Array) -> None:
        """Add the samples of the stroke."""
        own = self.features[rows].transpose(1, 2, 0)
        self.information += own @ own.transpose(0, 2, 1)
        self.moment += np.einsum("jfk,kj->jf", own, torque)


class Perceptron:
    """A multilayer perceptron over features (n, F), trained on all strokes so far (scikit-learn)."""

    def __init__(self, features: Array, joints: int):
        from sklearn.neural_network import MLPRegressor

        self.features, self.torque = features, np.zeros((0, joints))
        # "adam" counts its passes from the first on; each training goes EPOCHS further
        self.network = MLPRegressor(
            hidden_layer_sizes=(HIDDEN,), max_iter=EPOCHS, random_state=0, tol=0.0, warm_start=True
        )

    def predict(self, rows: slice) -> Array:
        """The outputs of the network; zero in the first stroke."""
        shape = (rows.stop - rows.start, self.torque.shape[1])
        return self.network.predict(self.features[rows]).reshape(shape) if self.torque.size else np.zeros(shape)

    def learn(self, rows: slice, torque: Array) -> None:
        """Train on all samples."""
        import warnings

        self.torque = np.concatenate([self.torque, torque])
        with warnings.catch_warnings(action="ignore"):  # it says that it has not converged
            self.network.fit(self.features[rows.stop - len(self.torque) : rows.stop], self.torque)


@dataclass
class Both:
    """A torque that does not depend on what is above it, and a learner of what it lacks."""

    known: Learner
    above: Learner

    def predict(self, rows: slice) -> Array:
        """The sum."""
        return self.known.predict(rows) + self.above.predict(rows)

    def learn(self, rows: slice, torque: Array) -> None:
        """The learner gets what is left."""
        self.above.learn(rows, torque - self.known.predict(rows))
        self.known.learn(rows, torque)


def make_tables(problem: Problem) -> Mapping[str, Maker]:
    """Makers of learners that need no model, by name; those over the phase only where a motion repeats."""
    signals, blocks = problem.signals, problem.machine.blocks
    plan = low_pass(signals.command, signals.log.period)
    rate = differentiate(plan, signals.log.period)
    by_state = [np.concatenate([plan[:, b], rate[:, b]], axis=1) for b in blocks]
    found: dict[str, Maker] = {"CMAC over angles and velocities": lambda: CmacLearner(blocks, by_state)}
    if signals.repeats:
        turn = np.stack([np.cos(2.0 * np.pi * signals.phase), np.sin(2.0 * np.pi * signals.phase)], axis=1)
        with_speed = np.column_stack([turn, signals.speed / signals.speed.max()])
        apart = np.abs((signals.phase[:, None] - np.arange(BUMPS) / BUMPS + 0.5) % 1.0 - 0.5)
        bumps = np.exp(-0.5 * (apart * BUMPS / 1.2) ** 2)
        bumps /= bumps.sum(axis=1, keepdims=True)
        found |= {
            "stroke before": lambda: Iterative(signals),
            "ILC": lambda: Iterative(signals, GAIN, HARMONICS),
            "norm-optimal ILC": lambda: Iterative(signals, 1.0 / (1.0 + CHANGE), rough=ROUGH / (1.0 + CHANGE)),
            "CMAC over phase": lambda: CmacLearner(blocks, [turn] * len(blocks)),
            "CMAC over phase and speed": lambda: CmacLearner(blocks, [with_speed] * len(blocks)),
            "RBF over phase": lambda: Linear(signals, bumps[:, None]),
        }
    return found


def make_networks(problem: Problem, angle: Array, velocity: Array) -> Mapping[str, Maker]:
    """Makers of learners over the motion (n, J) with which a model answers the commands of the log, by name."""
    signals = problem.signals
    period = signals.log.period
    motion = (angle, velocity, differentiate(low_pass(velocity, period, 20.0), period))
    features = np.concatenate(motion, axis=1)
    features = (features - features.mean(axis=0)) / (features.std(axis=0) + 1e-9)
    random, size = np.random.default_rng(0), features.shape[1]
    turns = features @ (random.normal(size=(size, FEATURES)) * 1.5 / np.sqrt(size))
    waves = np.sqrt(2.0 / FEATURES) * np.cos(turns + random.uniform(0.0, 2.0 * np.pi, FEATURES))
    fourier = np.concatenate([waves, 0.2 * features, np.ones((len(features), 1))], axis=1)
    joints = problem.make_regressors(KNOTS, motion)
    joints[..., 0] *= 0.1  # of a rotor: the prior is of 0.1 kg m^2
    rigid = problem.machine.compute_torque(*motion, signals.log.orientation)
    regressor = np.concatenate([joints, rigid[..., None]], axis=-1)
    prior = np.append(np.zeros(OWN + KNOTS), 1.0)
    return {
        "random Fourier features": lambda: Linear(signals, fourier[:, None]),
        "regressor of the model": lambda: Linear(signals, regressor, prior, 1.0),
        "perceptron": lambda: Perceptron(features, signals.torque.shape[1]),
    }


def place_below(problem: Problem, name: str, torque: Array) -> Mapping[str, Maker]:
    """Makers of a known torque (n, J), alone and below each table of :func:`make_tables`, by name."""
    fixed = Fixed(torque)
    return {name: lambda: fixed} | {
        f"{name} and {table}": lambda make=make: Both(fixed, make())  # type: ignore[misc]
        for table, make in make_tables(problem).items()
        if table in PLACED
    }


@dataclass(frozen=True)
class Stroke:
    """A stroke of a log, (rows, J) each; what was measured is None until it is over."""

    period: float
    """Time between two rows, s."""
    phase: Array
    """(rows,) from 0 to 1."""
    command: Array
    """Angles that the drives were given, rad."""
    command_rate: Array
    """Their derivative, rad/s."""
    angle: Array | None = None
    """Measured, rad."""
    torque: Array | None = None
    """Torque of the drives, which the method predicts, N m."""


@dataclass
class Entered:
    """A method of a user as a learner; it is given copies, and of the next stroke nothing that was measured.

    ``method.fit(strokes)`` is called after every stroke with all so far; ``method.predict(stroke)`` returns the
    torque (rows, J) of the next one, N m.
    """

    signals: Signals
    method: Any
    strokes: list[Stroke] = field(default_factory=list)

    @cached_property
    def _rate(self) -> Array:
        """Rates of all commands, rad/s."""
        return differentiate(self.signals.command, self.signals.log.period)

    def _cut(self, rows: slice) -> Stroke:
        own = self.signals
        return Stroke(own.log.period, own.phase[rows].copy(), own.command[rows].copy(), self._rate[rows].copy())

    def predict(self, rows: slice) -> Array:
        """What the method says; raises ValueError unless it is finite numbers of the right shape."""
        found = np.asarray(self.method.predict(self._cut(rows)), dtype=float)
        if found.shape != (shape := self.signals.torque[rows].shape) or not np.isfinite(found).all():
            raise ValueError(
                f"the torque of stroke {self.signals.stroke[rows.start]} has shape {found.shape} or is not finite: "
                f"must be finite numbers of shape {shape}"
            )
        return found

    def learn(self, rows: slice, torque: Array) -> None:
        """Let it fit to one more stroke."""
        angle = self.signals.log.angle[rows].copy()
        self.strokes.append(replace(self._cut(rows), angle=angle, torque=torque.copy()))
        self.method.fit(list(self.strokes))
