"""Page of an analysed log: advice for learning on its robot, tables and figures; and the JSON of its values."""

import json
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from cmacexp.addons.gap.analysis import FIRST, GENERIC, Gap
from cmacexp.addons.gap.problem import NAMES, SIGNED
from cmacexp.addons.gap.validation import OFTEN
from cmacexp.cmac.rules import derive_rate
from cmacexp.data.folder import OUT_KEY, new_result
from cmacexp.data.manifest import REPORT
from cmacexp.errors import in_one_line
from cmacexp.loop.guard import DRIFT_RATIO
from cmacexp.models.loop_delay import LoopDelay
from cmacexp.models.robot_gains import DECAY_TIME, choose_feedback
from cmacexp.report.figures import Panel, Series, draw
from cmacexp.report.page import Renderer, Report, render_markdown, write_report
from cmacexp.typing import Array, DataFrame, Figure

JSON = "gap.json"
OPTION = "as_built.yaml"
PARAMETERS = ["joint", "units", "rotor inertia", "viscous", "offset", "spring", "friction"]
"""Columns of the table of parameters."""
SHOWN = 6
"""Number of learners in the figure."""


def find_best(values: dict[str, Any]) -> str:
    """Return the name of the predictor that leaves the least torque, as the mean of strokes."""
    return min(values["left"], key=lambda name: float(values["left"][name]["value"]))


NOT_SHOWN = 1.5
"""What joints of the first half leave, over what the model leaves, above which that half does not show them."""


def summarise(values: dict[str, Any]) -> str:
    """Summarise the values in the first sentences of the page, with the number of strokes and intervals."""
    left = values["left"]
    best = find_best(values)
    fastest = left[best]["fastest"]
    robot = Path(values["robot"]).name
    strokes = "strokes" if values["repeats"] else "windows"
    if "model" in left:
        model = f"the model of {robot} leaves {left['model']['value']:.1f} % and the best predictor ({best})"
    elif values["explained"]:
        percents = list(values["explained"]["all"].values())
        is_worse = ", which therefore does not show them" * bool(percents[2] > NOT_SHOWN * percents[1])
        model = (
            f"the model of {robot} leaves {percents[1]:.1f} % along the measured motion and joints identified on the "
            f"first half{is_worse} {percents[2]:.1f} %, in the second half; the best learner, without a model "
            f"({best}), leaves"
        )
    else:
        model = f"the best learner, without a model ({best}), leaves"
    text = (
        f"Of the torque of this log {model} {left[best]['value']:.1f} % "
        f"[{left[best]['low']:.1f}, {left[best]['high']:.1f}] on {left[best]['n']} {strokes} that it had not seen"
    )
    if values["repeats"]:
        text += f", {fastest['value']:.1f} % [{fastest['low']:.1f}, {fastest['high']:.1f}] on the fastest"
    text += "."
    if values["lag"]:
        text += f" Joints are {1e3 * values['lag']['value']:.0f} ms behind their commands."
    if "acting" in values:
        name, acting = min(
            values["acting"]["with_velocity"].items(), key=lambda item: float(item[1]["tracking"]["worst"])
        )
        text += (
            f" On the identified plant {name} leaves, when it acts, at most {acting['tracking']['worst']:.0f} % of "
            f"the tracking error from stroke {FIRST} on."
        )
    return text


def find_gains(gap: Gap, loop_delay: LoopDelay) -> Array:
    """Return feedback gains (2, J), kp in N m/rad and kd in N m s/rad, by :mod:`cmacexp.models.robot_gains`.

    They are for a loop that is closed at the sampling rate of the log, with ``loop_delay``; the rule is applied to
    the least effective inertia of each joint in place of the least effective mass of a foot.
    """
    problem = gap.problem
    period = gap.signals.log.period
    rotors = (problem.machine.losses if gap.fitted is None else gap.fitted.values)[:, 0]
    least = np.empty(len(rotors))
    for block, expansion in zip(problem.machine.blocks, problem.expansions, strict=True):
        inverse = np.linalg.inv(expansion.mass + np.diag(rotors[block]))
        least[block] = (1.0 / np.diagonal(inverse, axis1=1, axis2=2)).min(axis=0)
    kd = choose_feedback(loop_delay, period) * least / period
    return np.array([kd / DECAY_TIME, kd])


def advise(gap: Gap) -> list[str]:
    """Return advice for learning on this robot: lead, rate, gains, inputs and guard, one sentence each."""
    values = gap.values
    left = values["left"]
    period = values["period"]
    delay = values.get("delay", {}).get("value", 0.0)
    loop_delay = LoopDelay(max(0, round(delay / period)))
    lead = loop_delay.count_samples(period) + 1
    kp, kd = find_gains(gap, loop_delay)
    advice = [
        f"Lead: {lead} samples of {1e3 * period:.1f} ms (a delay of {1e3 * delay:.1f} ms, and one sample until "
        f"torque shows in the feedback); rate: {derive_rate(lead):.3f} at that lead, by the rule of "
        "`learning.rate=auto`.",
        f"Gains of a loop that is closed at this sampling rate, by rule: kp {kp.min():.3g} to {kp.max():.3g} "
        f"N m/rad, kd {kd.min():.3g} to {kd.max():.3g} N m s/rad; drives that close it by themselves may have more.",
    ]
    if "stroke before" in left:
        phase, state = (left[name]["value"] for name in ("stroke before", "CMAC over angles and velocities"))
        advice.append(
            f"Address what is learnt by {'phase' if phase < state else 'angles and velocities'}: "
            f"{min(phase, state):.1f} % left instead of {max(phase, state):.1f} %."
        )
    if values["gains"]:
        lag = max((1e3 * d / p for p, d in zip(*values["gains"].values(), strict=True) if p > 0.0), default=0.0)
        advice.append(f"Feed desired velocities forward: without them up to kd/kp = {lag:.0f} ms of lag remain.")
    best = left[find_best(values)]
    spread = 1.0 + (best["fastest"]["high"] - best["fastest"]["low"]) / 2.0 / max(best["fastest"]["value"], 1e-9)
    torque = [np.sqrt((gap.signals.torque[gap.signals.rows(k)] ** 2).mean()) for k in range(1, gap.signals.count + 1)]
    advice.append(
        f"Margin of the guard: resampled, what the best predictor leaves of one stroke varies by a factor of "
        f"{spread:.2f}; the guard acts at {DRIFT_RATIO:g}, {'above' if spread < DRIFT_RATIO else 'within'} that. "
        f"Between the speeds of this log the torque itself varies by {max(torque) / max(min(torque), 1e-12):.2f}: "
        "compare cycles of one speed only."
    )
    return advice


def _draw_strokes(gap: Gap) -> Figure:
    """Plot the percent of the torque that the best learners leave in each stroke."""
    left = gap.values["left"]
    names = sorted(left, key=lambda name: left[name]["value"])[:SHOWN]
    strokes = np.arange(2, gap.signals.count + 1)
    series = [Series(name, strokes, left[name]["strokes"][1:]) for name in names]
    return draw([Panel("Torque left", "stroke", "left, %", series)], columns=1, height=3.0)


def _tabulate(gap: Gap) -> dict[str, Callable[[], DataFrame]]:
    """Return functions that make the tables of the page, by name of the table."""
    from pandas import DataFrame

    values = gap.values
    lags = {name: 1e3 * lag["value"] for name, lag in (values["lag"] or {"joints": {}})["joints"].items()}
    explained = values["explained"] or {"all": {}, "joints": {}}
    models = explained["all"]
    tables: dict[str, tuple[list[str], Iterable[list[Any]]]] = {
        "left": (
            ["predictor", "left, %", "strokes", "fastest, %", "fastest if frozen, %"],
            (
                [
                    name,
                    _format_interval(left),
                    left["n"],
                    _format_interval(left["fastest"]),
                    f"{left['frozen']['fastest']['value']:.1f}",
                ]
                for name, left in sorted(values["left"].items(), key=lambda item: item[1]["value"])
            ),
        ),
        "explained": (
            ["joint", *(f"{name}, %" for name in models), "lag, ms"],
            (
                [name, *percents.values(), lags.get(name)]
                for name, percents in {"all": models, **explained["joints"]}.items()
            ),
        ),
    }
    if gap.fitted is not None:
        validation = values["validation"]
        first, last = validation["reverse_fitted_on"]
        tables |= {
            "validation": (
                ["plant", f"strokes 1 to {first - 1}", f"{first} to {last - 1}", f"{last}", "all"],
                ([name, *distances.values()] for name, distances in validation["distance"].items()),
            ),
            "choice": (
                ["model of a joint", "parameters", "unseen, mrad"],
                (list(model.values()) for model in validation["choice"]["models"]),
            ),
            "parameters": (PARAMETERS, tabulate_parameters(values)),
        }
    if "acting" in values:
        tables |= {
            "acting": (
                [
                    "feedforward",
                    "torque, log predicts, %",
                    "torque, obtained, %",
                    "tracking, mean, %",
                    "tracking, worst, %",
                ],
                (
                    [
                        f"{name}{', drives as logged' if mode == 'as_logged' else ''}",
                        percents.get("torque_predicted"),
                        percents["torque_obtained"]["mean"],
                        percents["tracking"]["mean"],
                        percents["tracking"]["worst"],
                    ]
                    for mode in ("as_logged", "with_velocity")
                    for name, percents in values["acting"][mode].items()
                ),
            ),
        }
    return {name: partial(DataFrame, list(rows), columns=columns) for name, (columns, rows) in tables.items()}


def _format_interval(estimate: dict[str, Any]) -> str:
    return f"{estimate['value']:.1f} [{estimate['low']:.1f}, {estimate['high']:.1f}]"


def tabulate_parameters(values: dict[str, Any]) -> list[list[str]]:
    """Return a row for each joint with its parameters, see PARAMETERS; without an interval, only the value."""
    return [
        [
            name,
            ", ".join(params["unit"]),
            *(_format_error(params[key], key in NAMES[SIGNED]) if key in params else "-" for key in NAMES),
            _format_friction(params["coulomb_friction"]),
        ]
        for name, params in values["parameters"].items()
    ]


def _format_error(estimate: dict[str, Any], is_signed: bool) -> str:
    """Return a value with its standard error, or the end of its interval if that of a positive one exceeds it."""
    value, deviation = estimate["value"], estimate["deviation"]
    if deviation is None:
        return f"{value:.3g}"
    return f"{value:.3g} ± {deviation:.2g}" if is_signed or deviation < value else f"< {value + 1.96 * deviation:.2g}"


def _format_friction(estimate: dict[str, Any]) -> str:
    """Return the friction at each knot over the angle, with the largest of their standard errors."""
    values = ", ".join(f"{friction:.3g}" for friction in estimate["value"])
    return values if estimate["deviation"] is None else f"{values} ± {max(estimate['deviation']):.2g}"


def make_option(gap: Gap) -> str:
    """Return the YAML of an option of ``conf/plant/as_built`` with the identified joints, by names in the model."""
    import yaml

    joints = {}
    for name, params in zip(gap.problem.machine.joints, gap.values["parameters"].values(), strict=True):
        numbers = {key: value["value"] for key, value in params.items() if isinstance(value, dict)}
        numbers |= {key: -numbers[key] for key in NAMES[SIGNED] if key in numbers}  # here: torque on the joint
        joints[name] = {key: _round(value) for key, value in (numbers | {"range": params["range"]}).items()}
    option = {
        **dict.fromkeys(("joint_friction", "joint_damping", "rotor_inertia")),
        **{"trunk_mass_factor": 1.0, "trunk_inertia_factor": 1.0, "leg_mass_factor": 1.0, "trunk_shift": 0.0},
        "joints": joints,
    }
    robot, log = (in_one_line(Path(gap.values[key]).name) for key in ("robot", "log"))
    origin = f"# Joints of {robot}, identified from {log}.\n"
    return origin + yaml.safe_dump(option, sort_keys=False, default_flow_style=None, width=120)


def _round(value: "float | list[float]") -> "float | list[float]":
    """Round a value, or each of a list, to four significant digits."""
    return [float(f"{number:.4g}") for number in value] if isinstance(value, list) else float(f"{value:.4g}")


def write_page(gap: Gap, folder: Path) -> Path:
    """Write page, JSON and an option file of identified joints into ``folder``; return the path of the page."""
    values = gap.values | {"summary": summarise(gap.values), "advice": advise(gap)}
    variables = {
        "validation": None,
        "acting": None,
        "refused": [],
        **values,
        "window": gap.signals.window,
        "generic": GENERIC,
        "first": FIRST,
        "often": OFTEN,
    }
    with new_result(folder, OUT_KEY, REPORT) as result:
        result.write_text(JSON, json.dumps(values, indent=1) + "\n")
        if gap.fitted is not None:
            result.write_text(OPTION, make_option(gap))
        template = Path(__file__).with_name("page.md.jinja")
        sections = render_markdown(
            template.read_text(encoding="utf-8"),
            template,
            "What a learner would gain",
            Renderer(result.part),
            {"strokes": lambda: _draw_strokes(gap)},
            _tabulate(gap),
            variables,
        )
        robot, log = (Path(gap.values[key]).name for key in ("robot", "log"))
        title = f"The gap between {robot} and its log {log}"
        return write_report(Report(title, values["summary"], sections, {"log": gap.values["log"]}), result)
