"""The page of an analysed log: sentences, tables and figures; and its JSON."""

import json
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cmacexp.data.folder import OUT_KEY, new_result
from cmacexp.data.manifest import REPORT
from cmacexp.gap.advice import advise, summarise
from cmacexp.gap.analysis import FIRST, GENERIC, Gap
from cmacexp.gap.identify import NAMES
from cmacexp.gap.signals import WINDOW
from cmacexp.report.figures import Panel, Series, draw
from cmacexp.report.markdown import render_markdown
from cmacexp.report.page import Renderer, Report, write_report

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

JSON, OPTION = "gap.json", "as_built.yaml"
SHOWN = 6
"""Learners in the figure."""


def _draw_strokes(gap: Gap) -> "Figure":
    """Percent left in each stroke for the best learners."""
    left = gap.values["left"]
    names = sorted(left, key=lambda name: left[name]["value"])[:SHOWN]
    strokes = np.arange(2, gap.signals.count + 1)
    series = [Series(name, strokes, left[name]["strokes"][1:]) for name in names]
    return draw([Panel("Torque left", "stroke", "left, %", series)], columns=1, height=3.0)


def _tabulate(gap: Gap) -> "dict[str, Callable[[], DataFrame]]":
    """Makers of the tables of the page by name."""
    from pandas import DataFrame

    values = gap.values
    lags = {name: 1e3 * own["value"] for name, own in (values["lag"] or {"joints": {}})["joints"].items()}
    models = values["explained"]["all"]
    tables: dict[str, tuple[list[str], Iterable[list[Any]]]] = {
        "left": (
            ["predictor", "left, %", "strokes", "fastest, %", "fastest if frozen, %"],
            (
                [
                    name,
                    _interval(own),
                    own["n"],
                    _interval(own["fastest"]),
                    f"{own['frozen']['fastest']['value']:.1f}",
                ]
                for name, own in sorted(values["left"].items(), key=lambda item: item[1]["value"])
            ),
        ),
        "explained": (
            ["joint", *(f"{name}, %" for name in models), "lag, ms"],
            (
                [name, *own.values(), lags.get(name)]
                for name, own in {"all": models, **values["explained"]["joints"]}.items()
            ),
        ),
    }
    if gap.fitted is not None:
        found = values["validation"]
        first, last = found["reverse_fitted_on"]
        tables |= {
            "validation": (
                ["plant", f"strokes 1 to {first - 1}", f"{first} to {last - 1}", f"{last}", "all"],
                ([name, *own.values()] for name, own in found["distance"].items()),
            ),
            "choice": (
                ["model of a joint", "parameters", "unseen, mrad"],
                (list(own.values()) for own in found["choice"]["models"]),
            ),
            "parameters": (
                ["joint", "rotor, kg m²", "viscous, N m s/rad", "offset, N m", "spring, N m", "friction, N m"],
                (
                    [
                        name,
                        *(
                            f"{own[key]['value']:.3g} ± {own[key]['deviation']:.2g}" if key in own else "-"
                            for key in NAMES
                        ),
                        ", ".join(f"{each:.2f}" for each in own["coulomb_friction"]["value"]),
                    ]
                    for name, own in values["parameters"].items()
                ),
            ),
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
                        own.get("torque_predicted"),
                        own["torque_obtained"]["mean"],
                        own["tracking"]["mean"],
                        own["tracking"]["worst"],
                    ]
                    for mode in ("as_logged", "with_velocity")
                    for name, own in values["acting"][mode].items()
                ),
            ),
        }
    return {name: partial(DataFrame, list(rows), columns=columns) for name, (columns, rows) in tables.items()}


def _interval(own: dict[str, Any]) -> str:
    return f"{own['value']:.1f} [{own['low']:.1f}, {own['high']:.1f}]"


def make_option(gap: Gap) -> str:
    """The identified joints as an option of ``conf/plant/as_built``, by their names in the model."""
    import yaml

    joints = {
        name: {key: _round(value["value"] if isinstance(value, dict) else value) for key, value in own.items()}
        for name, own in zip(gap.problem.machine.joints, gap.values["parameters"].values(), strict=True)
    }
    others: dict[str, float | None] = dict.fromkeys(("joint_friction", "joint_damping", "rotor_inertia"))
    others |= {"trunk_mass_factor": 1.0, "trunk_inertia_factor": 1.0, "leg_mass_factor": 1.0, "trunk_shift": 0.0}
    origin = f"# Joints of {Path(gap.values['robot']).name}, identified from {Path(gap.values['log']).name}.\n"
    return origin + yaml.safe_dump({**others, "joints": joints}, sort_keys=False, default_flow_style=None, width=120)


def _round(value: "float | list[float]") -> "float | list[float]":
    """To four digits."""
    return [float(f"{each:.4g}") for each in value] if isinstance(value, list) else float(f"{value:.4g}")


def write_page(gap: Gap, folder: Path) -> Path:
    """Write page, JSON and, if joints were identified, their option file into ``folder``; returns the page."""
    values = gap.values | {"summary": summarise(gap.values), "advice": advise(gap)}
    shown = {"validation": None, "refused": [], **values, "window": WINDOW, "generic": GENERIC, "first": FIRST}
    with new_result(folder, OUT_KEY, REPORT) as place:
        place.write_text(JSON, json.dumps(values, indent=1) + "\n")
        if gap.fitted is not None:
            place.write_text(OPTION, make_option(gap))
        template = Path(__file__).with_name("page.md")
        sections = render_markdown(
            template.read_text(encoding="utf-8"),
            template,
            "What a learner would gain",
            Renderer(place.part),
            {"strokes": lambda: _draw_strokes(gap)},
            _tabulate(gap),
            shown,
        )
        title = f"The gap between {gap.values['robot']} and its log {Path(gap.values['log']).name}"
        return write_report(Report(title, values["summary"], sections, {"log": gap.values["log"]}), place)
