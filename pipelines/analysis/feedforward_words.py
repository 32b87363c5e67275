"""Text of the comparison of feedforwards: tables, advice and claims."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import pandas as pd

from cmacexp.report.page import Claim, Table, Text
from pipelines.analysis.feedforward_cost import ratios
from pipelines.analysis.feedforward_kinds import (
    ALONE,
    CMAC,
    EXACT,
    ILC,
    KINDS,
    LEARNERS,
    MLP,
    ONE_LEG,
    RATES,
    RBF,
    WRONG,
    Course,
    courses,
    level,
    of_kind,
    ranked,
    rate_group,
    spread,
)
from pipelines.analysis.feedforward_memory import bytes_of
from pipelines.analysis.measured import digits, listed, size_of
from pipelines.shared.runs import Runs

SHOWN = (5, 20)
CLEARLY = 0.9
"""Less than this fraction of CMAC's mean counts as better."""
SLOW = 2.0
"""This multiple of CMAC's cycles counts as a long time of training."""

READING = (
    "All run with the same feedback, reference=aware and learning.lead=1, the law that lasts, at the paper's rate. "
    "Models act from the first cycle on; what learns begins in the second. Mean ± standard deviation over five seeds "
    "for what depends on the seed: the hash of a CMAC, the initial weights of the perceptron (MLP). RBF: 100 "
    "normalised Gaussians along the path. ILC: iterative learning control, a torque for every sample, low-passed at "
    "20 Hz."
)


def shown(course: Course) -> list[int]:
    """The cycles whose errors are shown: those that were run, else the last."""
    last = course.x.shape[1]
    return [cycle for cycle in SHOWN if cycle <= last] or [last]


def _both(x: np.ndarray, y: np.ndarray) -> str:
    return f"{spread(x)} / {spread(y)}".replace(" ± ", "±")


def accuracy(found: Mapping[str, Course], tilt: bool = False) -> list[Table]:
    """Position and force errors of all kinds at the cycles shown and at the best one."""
    cycles = shown(found[CMAC])
    columns = [*(f"cycle {cycle}" for cycle in cycles), "best"]
    position, force = [], []
    for kind, course in found.items():
        last = int(np.median(course.best)) + 1
        at = [_both(course.at(course.x, c), course.at(course.y, c)) for c in cycles]
        needed = spread(course.cycles_to(level(found[ALONE])), ".0f") if KINDS[kind].learns else "-"
        best = f"{_both(course.at_best(course.x), course.at_best(course.y))} ({last})"
        position.append([kind, *at, best, needed])
        rows = [spread(course.at(course.force, c)) for c in cycles]
        other = course.tilt if tilt else course.settled
        rows += [spread(course.at(other, c)) for c in cycles]
        force.append([kind, *rows, spread(course.at_best(course.force)), spread(course.at_best(other))])
    second = "tilt, mrad" if tilt else "settled, %"
    captions = (
        "Transfer error in x / y, mm; best: least in the plane, with its cycle; learnt: first cycle from which on it "
        "stays at most a tenth of that of feedback alone",
        f"Force error over support, N, and {'largest tilt' if tilt else 'error of the settled force'}",
    )
    names = [f"{what}, cycle {c}" for what in ("rms, N", second) for c in cycles]
    return [
        Table(["feedforward", *columns, "learnt"], position, captions[0]),
        Table(["feedforward", *names, "rms, N, best", f"{second}, best"], force, captions[1]),
    ]


def _means(found: Mapping[str, Course], value: Callable[[Course], np.ndarray]) -> dict[str, float]:
    means = {kind: float(np.mean(value(course))) for kind, course in found.items() if KINDS[kind].learns}
    return {kind: np.inf if np.isnan(mean) else mean for kind, mean in means.items()}


def measures(found: Mapping[str, Course]) -> dict[str, dict[str, float]]:
    """Of every learner what is compared, all the better the less."""
    cycles, tenth = shown(found[CMAC]), level(found[ALONE])
    by_cycle = {
        f"transfer error, mm, in cycle {c}": _means(found, lambda course, c=c: course.at(course.error, c))
        for c in cycles
    }
    return {
        "cycles to a tenth of the error": _means(found, lambda course: course.cycles_to(tenth)),
        **by_cycle,
        "best transfer error, mm,": _means(found, lambda course: course.at_best(course.error)),
        f"force error, N, in cycle {cycles[-1]}": _means(found, lambda course: course.at(course.force, cycles[-1])),
    }


def beaten(found: Mapping[str, Course]) -> str:
    """Where a feedforward is better than the paper's CMAC, and where none is."""
    comparisons = []
    for what, values in measures(found).items():
        better = [k for k in ranked(values) if k != CMAC and values[k] < CLEARLY * values[CMAC]]
        own = "never" if np.isinf(values[CMAC]) else digits(values[CMAC])
        names = ", ".join(f"{kind} {digits(values[kind])}" for kind in better)
        comparisons.append(f"{what}: {names} against {own}" if better else f"{what}: none ({own})")
    return "Better than the paper's CMAC by more than a tenth of it: " + "; ".join(comparisons) + "."


def _models(found: Mapping[str, Course]) -> str:
    last = shown(found[CMAC])[-1]
    wrong = max(float(found[name].at(found[name].error, last)[0]) for name in WRONG.values())
    learnt = _means(found, lambda course: course.at(course.error, last))
    under = [kind for kind in ranked(learnt) if learnt[kind] < wrong]
    return (
        f"A model with masses 20 % off leaves up to {digits(wrong)} mm, the exact one "
        f"{digits(float(found[EXACT].at(found[EXACT].error, last)[0]))} mm; in cycle {last} "
        f"{listed(under)} {'is' if len(under) == 1 else 'are'} below that."
    )


def _ends(found: Mapping[str, Course]) -> str:
    """Whether every run went on to its end."""
    short = [kind for kind, course in found.items() if set(course.statuses) != {"completed"}]
    return f"Not all go on to the end: {listed(short)} fell or diverged." if short else "All go on to the end."


def advice_one_leg(found: Mapping[str, Course]) -> str:
    """What to take for one leg that repeats its path."""
    compared = measures(found)
    fast, good = (
        ranked(compared["cycles to a tenth of the error"])[0],
        ranked(compared["best transfer error, mm,"])[0],
    )
    return (
        f"{_ends(found)} {_models(found)} Advice: where paths repeat, learn; {fast} gets there soonest, {good} in "
        "the end furthest. A model earns its place in the first cycles, before anything is learnt."
    )


def advice_four_legs(found: Mapping[str, Course]) -> str:
    """What to take for a walk."""
    compared = measures(found)
    fast, good = ranked(compared["cycles to a tenth of the error"])[0], ranked(list(compared.values())[-1])[0]
    return (
        f"{_ends(found)} {_models(found)} "
        f"Advice: on four legs take {fast} for speed of learning; {good} has the least force error in the last cycle "
        "shown."
    )


def learning_caption(found: Mapping[str, Course]) -> str:
    """Of the figure of learning curves."""
    return (
        f"Transfer error in the plane; dashed: a tenth of that of feedback alone, {digits(level(found[ALONE]))} mm; "
        "shaded: from the least to the largest over seeds."
    )


def smooth(jumping: Mapping[str, Course], found: Mapping[str, Course]) -> list[Table | Text]:
    """What a path without jumps changes for models and learners."""
    cycles = shown(found[CMAC])
    rows = [
        [kind, *(spread(course.at(course.error, c)) for c in cycles), spread(course.at_best(course.error))]
        for kind, course in found.items()
    ]
    last = cycles[-1]
    exact, before = (float(f[EXACT].at(f[EXACT].error, last)[0]) for f in (found, jumping))
    learnt = _means(found, lambda course: course.at(course.error, last))
    under = [kind for kind in ranked(learnt) if learnt[kind] < exact]
    said = f"{listed(under)} {'does' if len(under) == 1 else 'do'}" if under else "no learner does"
    return [
        Table(
            ["feedforward", *(f"cycle {c}, mm" for c in cycles), "best, mm"],
            rows,
            "Transfer error in the plane, with gait.vertical=two_cubics",
        ),
        Text(
            "The default path jumps in speed at lift-off and touch-down, which no torque follows; there the exact "
            f"model leaves {digits(before)} mm. Without jumps it leaves {digits(exact)} mm, and {said} better by "
            f"cycle {last}. Advice: plan paths without jumps before buying a better feedforward; then a model "
            "that is known well needs no learning, and one that is not is no substitute for it."
        ),
    ]


def rates(runs: Runs) -> list[Table | Text]:
    """How each learner does at other rates."""
    by_rate = {rate: courses(runs, rate_group(rate)) for rate in RATES}
    by_rate = {rate: found for rate, found in by_rate.items() if found}
    cycles = shown(next(iter(by_rate.values()))[CMAC])
    rows, best = [], {}
    for kind in LEARNERS:
        values, errors = [], {}
        for rate, found in by_rate.items():
            course = found[kind]
            values += [spread(course.at(course.error, c)) for c in cycles]
            errors[rate] = float(course.at(course.error, cycles[-1])[0])
        best[kind] = min(errors, key=lambda rate: errors[rate] if errors[rate] == errors[rate] else np.inf)
        rows.append([kind, *values])
    columns = [f"{rate:.2g}, cycle {c}" for rate in by_rate for c in cycles]
    first = cycles[0]
    by_kind = {
        kind: min(float(np.nan_to_num(f[kind].at(f[kind].error, first)[0], nan=np.inf)) for f in by_rate.values())
        for kind in LEARNERS
    }
    fastest = max(by_rate)
    worse = [
        kind
        for kind, course in by_rate[fastest].items()
        if not course.at(course.error, cycles[-1])[0] <= course.at(course.error, first)[0]
    ]
    chosen = ", ".join(f"{kind} {rate:.2g}" for kind, rate in best.items())
    return [
        Table(["feedforward", *columns], rows, "Transfer error in the plane, mm, by rate and cycle; one seed"),
        Text(
            "A learner that shares weights between neighbouring samples is taught many times over each cycle; one "
            "that does not, or that learns once a cycle, needs a larger rate for the same speed. At "
            f"{fastest:.2g} {listed(worse)} get worse with the cycles. Best in cycle {cycles[-1]}: {chosen}. Advice: "
            "compare learners at the rate that suits each; at its best rate "
            f"{ranked(by_kind)[0]} has the least error in cycle {first}, {digits(min(by_kind.values()))} mm, and "
            f"CMAC {digits(by_kind[CMAC])} mm."
        ),
    ]


def costs(runs: Runs, cost: pd.DataFrame, found: Mapping[str, Course]) -> list[Table | Text]:
    """Bytes of weights, and time of a step against feedback alone."""
    ratio, rows = ratios(cost), []
    memory = {}
    for kind in KINDS:
        own = next(iter(of_kind(runs, ONE_LEG, kind).values()))
        held, used = bytes_of(own)
        memory[kind] = used
        times = ratio.loc[kind]
        values = [size_of(held), size_of(used)] if KINDS[kind].learns else ["-", "-"]
        rows.append([kind, *values, digits(times["least"]), digits(times["median"])])
    small = ranked({kind: memory[kind] for kind in LEARNERS})[0]
    alone = 1e6 * float(cost.loc[cost["kind"] == ALONE, "seconds_per_step"].min())
    return [
        Table(
            ["feedforward", "weights", "of them used", "time of a step", "median"],
            rows,
            "Memory of one leg; processor time of a step of one leg over that of feedback alone: the least and the "
            "median of runs that took turns in one process",
        ),
        Text(
            f"Feedback alone takes {alone:.2g} µs a step here. Other programs that share caches and cores show "
            "in the median more than in the least time; differences of a tenth are noise. The perceptron runs in the "
            "step-by-step loop, and learns at the end of each cycle in Python; all others run in the compiled loop. "
            f"Advice: {small} needs least memory ({size_of(memory[small])} against {size_of(memory[CMAC])} that "
            "CMAC uses of its board); time is no reason to choose among those of the compiled loop."
        ),
    ]


def _verdict(good: Sequence[bool]) -> str:
    return "reproduced" if all(good) else "reproduced in part" if any(good) else "contradicted"


def _cycles(count: float) -> str:
    return "never" if np.isinf(count) else f"{count:.3g}"


def claims(runs: Runs, found: Mapping[str, Course], walk: Mapping[str, Course]) -> list[Claim]:
    """The paper's claims about CMAC against alternatives: on one leg (``found``) and on four (``walk``)."""
    needed, walked = (measures(each)["cycles to a tenth of the error"] for each in (found, walk))
    one, four = (", ".join(f"{kind} {_cycles(count)}" for kind, count in each.items()) for each in (needed, walked))
    first = {kind: next(iter(of_kind(runs, ONE_LEG, kind))) for kind in (CMAC, MLP, RBF, ILC)}
    soonest = [np.isfinite(n[CMAC]) and n[CMAC] <= min(n[kind] for kind in (RBF, MLP, ILC)) for n in (needed, walked)]
    return [
        Claim(
            "CMAC is suited to real-time control by its simple design and rapid learning",
            "section 1",
            f"Cycles to a tenth of the error of feedback alone, one leg: {one}; four legs: {four} (criterion: fewer "
            "with none of RBF, MLP, ILC, on one leg and on four)",
            _verdict(soonest),
            runs.links(*first.values()),
        ),
        Claim(
            "The drawback of a neural network that is trained to compensate for the model is its long training time",
            "section 1, of its reference 17",
            f"At the same rate MLP needs {_cycles(needed[MLP])}, CMAC {_cycles(needed[CMAC])} to a tenth of the "
            f"error (criterion: at least {SLOW:g} times as many)",
            _verdict([needed[MLP] >= SLOW * needed[CMAC]]),
            runs.links(first[MLP], first[CMAC]),
        ),
    ]
