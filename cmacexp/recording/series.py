"""Time series of a run: gait, forces, tracking errors, torques, posture, stability."""

import numpy as np
import rerun as rr

from cmacexp.recording import palette
from cmacexp.recording.entities import Entities
from cmacexp.recording.run_view import LegView, RunView
from cmacexp.typing import Array

Line = tuple[str, Array, tuple[int, ...]]
"""Name, values (steps,), colour."""


def _force_lines(leg: LegView) -> list[Line]:
    lines: list[Line] = [
        ("desired", leg["force_desired"], palette.DESIRED),
        ("actual", leg["force"], palette.ACTUAL),
    ]
    if not np.array_equal(leg["force"], leg["force_measured"]):
        lines.insert(1, ("measured", leg["force_measured"], palette.MEASURED))
    return lines


def _leg_lines(leg: LegView) -> dict[str, list[Line]]:
    error = {name: 1e3 * (leg[name] - leg[f"{name}_desired"]) for name in ("x", "y")}
    lines: dict[str, list[Line]] = {
        "force": _force_lines(leg),
        "error": [("x forward", error["x"], palette.ACTUAL), ("y down", error["y"], palette.FIRST_CYCLE)],
    }
    for joint in (1, 2):
        lines[f"torque_{joint}"] = [
            ("feedback", leg[f"tau_feedback_{joint}"], palette.FEEDBACK),
            ("feedforward", leg[f"tau_feedforward_{joint}"], palette.FEEDFORWARD),
        ]
    return lines


def _margin_lines(body: dict[str, Array]) -> list[Line]:
    planned = ("planned, nearest edge", 1e3 * body["stability_margin"], palette.DESIRED)
    if "true_stability_margin" not in body:  # of an earlier version
        return [planned]
    return [
        planned,
        ("true, nearest edge", 1e3 * body["true_stability_margin"], palette.LAST_CYCLE),
        ("true, front", 1e3 * body["true_margin_front"], palette.ACTUAL),
        ("true, rear", 1e3 * body["true_margin_rear"], palette.FIRST_CYCLE),
    ]


def _body_lines(body: dict[str, Array]) -> dict[str, list[Line]]:
    return {
        "tilt": [
            ("pitch, nose down", 1e3 * body["pitch"], palette.ACTUAL),
            ("roll, right side down", 1e3 * body["roll"], palette.FIRST_CYCLE),
        ],
        "height": [("height", 1e3 * body["height"], palette.LAST_CYCLE)],
        "margins": _margin_lines(body),
    }


def collect_series(view: RunView) -> dict[str, list[Line]]:
    """All time series by the name of their plot, ``leg_1/force`` or ``body/tilt``; N, mm, N m, mrad."""
    found = {f"leg_{leg.number}/{name}": lines for leg in view.legs for name, lines in _leg_lines(leg).items()}
    if view.walks:
        found |= {f"body/{name}": lines for name, lines in _body_lines(view.body).items()}
    return found


def _log_gait(entities: Entities, view: RunView, leg: LegView) -> None:
    """Support and transfer phases as a lane of the gait diagram (Fig. 14); only changes are written."""
    path = f"gait/{leg.number}_{leg.name.replace(' ', '_')}"
    style = rr.StateConfiguration(
        values=["support", "transfer"], labels=["support", "transfer"], colors=[palette.SUPPORT, palette.TRANSFER]
    )
    entities.log(path, style)
    changes = np.flatnonzero(np.diff(leg.support, prepend=~leg.support[:1]))
    states = np.where(leg.support[changes], "support", "transfer").tolist()
    entities.send_columns(path, rr.StateChange.columns(state=states), changes)


def log_series(entities: Entities, view: RunView) -> None:
    """All time series, several lines in one entity, and the gait diagram."""
    for path, lines in collect_series(view).items():
        names, values, colours = zip(*lines, strict=True)
        style = rr.SeriesLines(names=list(names), colors=list(colours), widths=[1.5] * len(lines))
        entities.log(f"series/{path}", style)
        columns = rr.Scalars.columns(scalars=np.stack(values, axis=1))
        entities.send_columns(f"series/{path}", columns)
    for leg in view.legs:
        _log_gait(entities, view, leg)
