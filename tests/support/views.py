"""Runs as they are drawn, made up."""

from dataclasses import replace

import numpy as np
import pyarrow as pa
from support.made_traces import make_trace

from cmacexp.data.manifest import make_manifest
from cmacexp.data.run import Run
from cmacexp.data.trace import Trace
from cmacexp.models.chain import chain_points
from cmacexp.recording.run_view import RunView

ROBOT_HIPS = ((0.19, 0.12), (0.19, -0.12), (-0.19, 0.12), (-0.19, -0.12))
FOOT_RADIUS = 0.02
HIPS = ((0.2, 0.1), (0.2, -0.1), (-0.2, 0.1), (-0.2, -0.1))
STEPS = 20
CONFIG = {"terrain": {"stiffness": 1e4}, "sampling_period": 0.1, "gait": {"cycle_time": 0.1 * STEPS}}


def make_walk(number=1, error=0.0, **columns) -> RunView:
    """One cycle of a level machine whose legs stand straight down, 0.5 m, and lift by 0.1 m in steps 6 to 9."""
    zero, lift = np.zeros(STEPS), np.where((np.arange(STEPS) >= 6) & (np.arange(STEPS) < 10), 0.1, 0.0)
    force = np.where(lift > 0.0, 0.0, 10.0)
    values = {"x": zero + error, "y": 0.5 - lift, "y_desired": 0.5 - lift, "q1": zero + np.pi / 2.0, "q2": zero}
    values |= {"force": force, "force_desired": force, "force_measured": force, "cycle": np.full(STEPS, number)}
    legs = make_trace("S" * 6 + "T" * 4 + "S" * 10, legs=4, **values | columns)
    body = {"cycle": values["cycle"], "height": zero + 0.5, "margin_front": np.linspace(0.2, 0.1, STEPS)}
    body |= dict.fromkeys(("cog_x", "cog_y", "yaw", "pitch", "roll", "stability_margin", "margin_rear"), zero)
    names = ("left_front", "right_front", "left_rear", "right_rear")
    machine = {
        "kind": "quadruped",
        "legs": {name: {"hip_x": x, "hip_y": y, "length_1": 0.25} for name, (x, y) in zip(names, HIPS, strict=True)},
    }
    manifest = make_manifest({"machine": machine, **CONFIG}, "completed", "", steps=number * STEPS)
    return RunView(Run("made", manifest), replace(legs, body=Trace(pa.table(body))), "made")


def make_chain(side):
    """A leg whose hip is 0.08 m inside its thigh, which hangs straight down at angles of zero; links of 0.2 m."""
    hinges = [[0, 0, -0.08 * side, 1, 0, 0], [0, 0, 0, 0, 0, 1], [0, 0.2, 0, 0, 0, 1]]
    return [*np.ravel(hinges).astype(float).tolist(), 0.0, 0.4, 0.0]


def make_robot_traces():
    """The trace of one cycle of a robot that stands on bent legs and swings each, and what its manifest holds."""
    chains = [make_chain(side) for _, side in np.sign(ROBOT_HIPS)]
    step, lifted = np.arange(STEPS), np.zeros((STEPS, 4), bool)
    for leg in range(4):
        lifted[4 * leg + 2 : 4 * leg + 5, leg] = True
    bend = 0.7 + 0.3 * lifted
    q = np.stack([0.1 * np.sin(step)[:, None] * lifted, bend, -2.0 * bend], axis=2)
    points = np.stack([chain_points(np.array(chain), q[:, leg]) for leg, chain in enumerate(chains)], axis=1)
    foot = points[:, :, 3]
    columns = {axis: foot[..., n] for n, axis in enumerate("xyz")}
    columns |= {f"{axis}_desired": foot[..., n] + 0.001 * (n + 1) for n, axis in enumerate("xyz")}
    columns |= {f"q{n + 1}": q[..., n] for n in range(3)} | {f"q{n + 1}_desired": q[..., n] for n in range(3)}
    columns |= {"force": np.where(lifted, 0.0, 30.0), "force_desired": np.where(lifted, 0.0, 30.0)}
    columns |= {"force_measured": columns["force"], "phase": np.where(lifted, "transfer", "support")}
    columns |= {f"tau_feedback_{n}": np.full((STEPS, 4), 3.0 * n) for n in (1, 2, 3)}
    columns |= {f"tau_force_{n}": np.full((STEPS, 4), 2.0 * n) for n in (1, 2, 3)}
    legs = make_trace("S" * STEPS, legs=4, in_space=True, **columns)
    zero = np.zeros(STEPS)
    body = {"step": step, "time": 0.1 * step, "cycle": zero + 1, "height": zero + foot[0, 0, 1]}
    body |= dict.fromkeys(("cog_x", "cog_y", "yaw", "pitch", "roll", "stability_margin", "margin_front"), zero)
    robot = {"chains": chains, "hips": [list(hip) for hip in ROBOT_HIPS], "foot_radius": FOOT_RADIUS}
    return replace(legs, body=Trace(pa.table(body))), make_manifest(
        {"machine": {"kind": "robot"}, **CONFIG}, "completed", "", robot=robot
    )


def make_robot() -> RunView:
    """The view of :func:`make_robot_traces`."""
    trace, manifest = make_robot_traces()
    return RunView(Run("made", manifest), trace)
