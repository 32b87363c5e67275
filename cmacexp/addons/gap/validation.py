"""The identified plant: chosen by cross-validation, fitted, validated on unseen strokes; refused parameters.

Learners are applied to it: the torque that they leave is compared with the prediction of the log, and tracking errors
are measured.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from cmacexp.addons.gap.analysis import FIRST, Gap, Report, add_learner, compare_rms
from cmacexp.addons.gap.identify import Fit, fit, replay_fit
from cmacexp.addons.gap.learners import PLACED, Both, Fixed, Iterative, Learner, Maker, make_tables, place_below
from cmacexp.addons.gap.problem import KNOWN, LEVELS, MASS_PRIOR, NAMES, SIGNED, TILT_PRIOR, Level, Problem
from cmacexp.addons.gap.replay import Expansion, make_drive
from cmacexp.addons.gap.signals import Signals, differentiate, low_pass
from cmacexp.typing import Array, Mask

IDENTIFIED = "identified from earlier strokes"
OFTEN = 12
"""Number of strokes up to which the plant is fitted again after every second one, then each time that it doubles."""
ABOVE = "CMAC over phase"
"""Table that is combined with the identified plant, beside ILC."""
SETTLE = 0.2
"""Time at the beginning of a log that is not fitted, s: the earlier commands are unknown."""
CORRELATED = 0.8
"""Correlation of delay and rotor inertia above which they cannot be identified separately."""
DISAGREEING = 3.0
"""Difference of two fits over its standard error, above which an interval is not given."""
UNITS = (["kg m^2", "N m s/rad", "N m"], ["kg", "N s/m", "N"])
"""Units of rotor inertia, viscous friction and torque of joints that turn, and that slide."""
ALONE = "desired velocity alone"


def identify(gap: Gap, set_done: Report = lambda done: None) -> None:
    """Identify the joints, validate them on unseen strokes, and score learners that use them.

    ``gap.values`` gets the parameters and errors, ``gap.replays`` the replays, ``set_done`` the progress.
    """
    problem = gap.problem
    count = gap.signals.count
    inner, train = split_strokes(count)
    chosen, models = choose_level(problem)
    set_done(0.3)
    forward = fit(problem, chosen, rows_of(gap.signals, 1, train))
    reverse = fit(problem, chosen, rows_of(gap.signals, train + 1, count))
    whole = gap.fitted = fit(problem, chosen, rows_of(gap.signals, 1, count), forward.values)
    set_done(0.6)
    for name, fitted in {"identified": forward, "identified, the reverse": reverse}.items():
        applied = problem.apply(fitted.masses)
        angle = replay_fit(applied, fitted)
        if gap.signals.log.has_drives:  # expanded along the replay itself, the equations hold to all orders
            angle = replay_fit(applied, fitted, applied.expand(angle, differentiate(angle, gap.signals.log.period)))
        gap.replays[name] = angle
    middle = max(train + 1, count - 1)
    spans = {"before": (1, train), "middle": (train + 1, middle), "last": (count, count), "all": (1, count)}
    gap.values |= {
        "validation": {
            "unit": "mrad",
            "fitted_on": [1, train],
            "reverse_fitted_on": [train + 1, count],
            "choice": {
                "models": models,
                "chosen": chosen.name,
                "fitted_on": [1, inner],
                "scored_on": [inner + 1, train],
            },
            "distance": {
                name: {span: measure_distance(gap.signals, angle, *strokes) for span, strokes in spans.items()}
                for name, angle in gap.replays.items()
            },
        },
        "parameters": describe_parameters(problem, whole),
        "masses": {
            problem.machine.find_link(joint)[0]: {"value": value, "deviation": deviation}
            for joint, (value, deviation) in whole.masses.items()
        },
        "delay": {"unit": "s", "value": whole.delay, "deviation": whole.delay_deviation},
        "covariances": [covariance.tolist() for covariance in whole.covariances],
        "refused": list(refuse_parameters(problem, whole)),
    }
    for joint, name in compare_fits(problem, forward, reverse):
        gap.values["parameters"][joint][name]["deviation"] = None
        sentence = f"interval of the {name.replace('_', ' ')} of {joint}: fits to both parts of the log disagree"
        gap.values["refused"].append(sentence)
    if gap.signals.log.has_drives:
        for name, make in list_identified(problem, chosen, gap.makers["model"]).items():
            add_learner(gap, name, make)
        gap.values["acting"] = act(gap, whole, forward)


def rows_of(signals: Signals, first: int, last: int) -> Mask:
    """Return the mask (n,) of the rows of strokes ``first`` to ``last``.

    Rows before the first stroke count as part of it, except for the first SETTLE seconds.
    """
    rows = np.zeros(len(signals.log.time), dtype=bool)
    begin = round(SETTLE / signals.log.period) if first == 1 else int(signals.bounds[first - 1])
    rows[begin : int(signals.bounds[last])] = True
    return rows


def measure_distance(signals: Signals, angle: Array, first: int, last: int) -> float:
    """Return the RMS difference of angles (n, J), rad, from measured ones in strokes ``first`` to ``last``, mrad."""
    rows = slice(int(signals.bounds[first - 1]), int(signals.bounds[last]))
    return float(1e3 * np.sqrt(((angle - signals.log.angle)[rows] ** 2).mean()))


def split_strokes(count: int) -> tuple[int, int]:
    """Return the last stroke for fitting models of joints, and the last for choosing one: after 1/3 and 2/3."""
    train = max(2, round(count * 2 / 3))
    return max(1, train // 2), train


def choose_level(problem: Problem) -> tuple[Level, list[dict[str, Any]]]:
    """Choose the model of joints that, fitted to the first third of the strokes, predicts the second third best.

    Returns also a row for each model, with its number of ``parameters`` and its error in ``mrad``.
    """
    inner, train = split_strokes(problem.signals.count)
    models = list[dict[str, Any]]()
    levels = LEVELS if problem.masses else LEVELS[:-1]
    for level in levels:
        fitted = fit(problem, level, rows_of(problem.signals, 1, inner))
        angle = problem.apply(fitted.masses).follow(fitted.values, fitted.delay)
        models.append(
            {
                "model": level.name,
                "parameters": int(level.free.sum()),
                "mrad": measure_distance(problem.signals, angle, inner + 1, train),
            }
        )
    return levels[int(np.argmin([model["mrad"] for model in models]))], models


def compare_fits(problem: Problem, one: Fit, other: Fit) -> Iterator[tuple[str, str]]:
    """Yield joint and name of each parameter by which two fits differ by more than DISAGREEING standard errors."""
    deviation = np.maximum(np.hypot(one.deviation, other.deviation), 1e-12)
    apart = np.abs(one.values - other.values) / deviation
    for j, joint in enumerate(problem.signals.log.joints):
        names = [name for k, name in enumerate(NAMES) if apart[j, k] > DISAGREEING and one.level.free[k]]
        if apart[j, len(NAMES) :].max() > DISAGREEING:
            names.append("coulomb_friction")
        yield from ((joint, name) for name in names)


def describe_parameters(problem: Problem, fitted: Fit) -> dict[str, Any]:
    """Return the parameters by joint with standard errors, and the range of friction and spring.

    ``unit`` is that of rotor inertia, viscous friction, and torque. An offset is the torque that the drive
    must supply: torque of the drive = rigid bodies + inertia + friction + offset. In an option of ``as_built`` its
    sign is that of the torque on the joint.
    """
    values = fitted.values.copy()
    values[:, SIGNED] *= -1.0
    columns: dict[str, int | slice] = {name: k for k, name in enumerate(NAMES[: fitted.level.named])}
    columns["coulomb_friction"] = slice(len(NAMES), None)
    return {
        joint: {
            "unit": UNITS[bool(problem.machine.is_prismatic[j])],
            **{
                name: {"value": values[j, k].tolist(), "deviation": fitted.deviation[j, k].tolist()}
                for name, k in columns.items()
            },
            "range": problem.ranges[:, j].tolist(),
        }
        for j, joint in enumerate(problem.signals.log.joints)
    }


def refuse_parameters(problem: Problem, fitted: Fit) -> Iterator[str]:
    """Yield the parameters that the log does not identify, each by name with the reason."""
    joints = problem.signals.log.joints
    unknown = {problem.machine.find_link(j)[0]: None for j in range(len(joints)) if j not in problem.masses}
    if unknown:
        limit = 100.0 * KNOWN * MASS_PRIOR
        yield f"masses of {', '.join(unknown)}: beside the joints they are not known to {limit:.0f} %"
    if (error := problem.tilt_error) > KNOWN * TILT_PRIOR:
        yield f"tilt of the base: its standard error is {np.degrees(error):.1f} degrees"
    strongest = fitted.delay_correlation[np.abs(fitted.delay_correlation).argmax()]
    if abs(strongest) > CORRELATED:
        yield f"delay apart from rotor inertia: their correlation is up to {strongest:.2f}"
    for j, joint in enumerate(joints):
        for k, name in enumerate(NAMES[:2]):
            if fitted.deviation[j, k] > max(fitted.values[j, k], 1e-9):
                yield f"{name.replace('_', ' ')} of {joint}: its standard error exceeds its value"
        if fitted.deviation[j, len(NAMES) :].max() > fitted.values[j, len(NAMES) :].mean():
            yield f"Coulomb friction of {joint}: its standard error exceeds its mean"


class Identified:
    """A predictor that replays the plant fitted to all strokes so far; it is fitted again after every second stroke.

    After OFTEN strokes it is fitted when their number has doubled, since a fit takes longer with every stroke. Until
    the first fit, ``before`` predicts. ``identify_to`` returns the fit to all strokes up to a given one, and the
    torque (n, J) of the drives in its replay, N m.
    """

    def __init__(self, signals: Signals, before: Learner, identify_to: Callable[[int], tuple[Fit, Array]]):
        self.signals = signals
        self.before = before
        self.identify_to = identify_to
        self.torque = np.zeros(0)

    def predict(self, rows: slice) -> Array:
        """Return the torque of the drives in the replay of the fitted plant, or that of ``before``."""
        return self.torque[rows] if self.torque.size else self.before.predict(rows)

    def learn(self, rows: slice, torque: Array) -> None:
        """Fit the plant to the measured angles of all strokes so far, if it is time."""
        stroke = int(self.signals.stroke[rows.start])
        doublings, rest = divmod(stroke, OFTEN)
        is_due = stroke % 2 == 0 if stroke <= OFTEN else rest == 0 and doublings.bit_count() == 1
        if is_due and stroke < self.signals.count:
            _, self.torque = self.identify_to(stroke)


def list_identified(problem: Problem, level: Level, before: Maker) -> Mapping[str, Maker]:
    """Return constructors of the identified plant, without and with ILC or a table, by name.

    ``before`` makes the learner that predicts until the first fit. All of them share the fits and their replays.
    """
    signals = problem.signals
    fits: dict[int, tuple[Fit, Array]] = {}

    def identify_to(stroke: int) -> tuple[Fit, Array]:
        if stroke not in fits:
            start = fits[max(fits)][0].values if fits else None
            fitted = fit(problem, level, rows_of(signals, 1, stroke), start)
            fits[stroke] = fitted, signals.compute_torque(replay_fit(problem.apply(fitted.masses), fitted))
        return fits[stroke]

    def make() -> Learner:
        return Identified(signals, before(), identify_to)

    makers: dict[str, Maker] = {IDENTIFIED: make}
    if signals.repeats:
        makers |= {
            f"{IDENTIFIED}, and ILC": lambda: Both(make(), Iterative(signals, 0.5)),
            f"{IDENTIFIED}, and {ABOVE}": lambda: Both(make(), make_tables(problem)[ABOVE]()),
        }
    return makers


def act(gap: Gap, plant: Fit, first: Fit) -> dict[str, Any]:
    """Apply learners to the ``plant`` fitted to the whole log; return their feedback torque and tracking error.

    Both are percentages of the values of feedback only. ``as_logged`` has the drives of the log and learners without
    a model, with the torque that the log predicts. ``with_velocity`` also feeds the desired velocity forward, and
    adds inverse dynamics of the plan to the learners: with the joints of the model, and with those of ``first``,
    which was fitted to the first strokes.
    """
    problem = gap.problem.apply(plant.masses)
    signals = gap.signals
    log = signals.log
    tables = make_tables(problem)
    as_logged = {name: tables[name] for name in PLACED if name in tables}
    plan = low_pass(signals.command, log.period)
    rate = differentiate(plan, log.period)
    motion = (plan, rate, differentiate(rate, log.period))
    equations = problem.expand(plan, rate)
    feedback_only = problem.replay(plant.values, plant.delay)
    makers: dict[str, Maker] = {ALONE: lambda: Fixed(np.zeros_like(plan)), **as_logged}
    models = {
        "model": (gap.problem, gap.problem.machine.losses),
        "identified": (gap.problem.apply(first.masses), first.values),
    }
    for name, (model, values) in models.items():
        rigid = model.machine.compute_torque(*motion, log.orientation)
        inverse = rigid + model.compute_joint_torque(values, motion)
        makers |= place_below(problem, f"inverse dynamics of the {name} joints", inverse)
    return {
        "unit": "% of the drives alone",
        "as_logged": {
            name: {
                "torque_predicted": gap.values["left"][name]["value"],
                **_run(problem, plant, make(), log.command_velocity, equations, feedback_only),
            }
            for name, make in as_logged.items()
        },
        "with_velocity": {
            name: _run(problem, plant, make(), rate, equations, feedback_only) for name, make in makers.items()
        },
    }


def _run(
    problem: Problem,
    plant: Fit,
    learner: Learner,
    rate: Array,
    equations: Sequence[Expansion],
    feedback_only: tuple[Array, Array],
) -> dict[str, Any]:
    """Simulate the ``plant`` under a learner that feeds its prediction of each stroke forward, and learns after it.

    It learns the sum of feedforward and feedback. ``rate`` (n, J), rad/s, is the commanded velocity, ``equations``
    are expanded along the commands, ``feedback_only`` are angles, rad, and velocities, rad/s, (n, J) without a
    learner. Returns the RMS of feedback torque and of tracking error, in percent of their values with feedback only.
    """
    signals = problem.signals
    log = signals.log
    command = signals.command
    begin = signals.bounds[0]
    logged, velocity = feedback_only
    reference = signals.compute_torque(logged)
    state = (logged[begin], velocity[begin])
    left, tracking = list[float](), list[float]()
    for stroke in range(1, signals.count + 1):
        rows = signals.rows(stroke)
        forward = learner.predict(rows)
        held = np.append(np.arange(len(forward)), len(forward) - 1)  # after the last row the state is read
        drive = make_drive(command[rows][held], rate[rows][held], forward[held], log.kp, log.kd)
        along = [Expansion(*(values[rows][held] for values in expansion)) for expansion in equations]
        angles, velocities = problem.replay(plant.values, plant.delay, along, drive, state)
        state = (angles[-1], velocities[-1])
        angle = angles[:-1]
        feedback = log.kp * (command[rows] - angle) + log.kd * (rate[rows] - differentiate(angle, log.period))
        learner.learn(rows, forward + feedback)
        left.append(compare_rms(feedback, reference[rows]))
        tracking.append(compare_rms(angle - command[rows], logged[rows] - command[rows]))
    return {
        name: {
            "mean": float(np.mean(percents[FIRST - 1 :])),
            "worst": float(np.max(percents[FIRST - 1 :])),
            "strokes": [round(percent, 2) for percent in percents],
        }
        for name, percents in {"torque_obtained": left, "tracking": tracking}.items()
    }
