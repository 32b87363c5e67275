"""One leg learns to step and to press (Lin & Song 1997, section 5, Fig. 10 to 13).

``python -m pipelines.one_leg_learning`` runs ``scenario=one_leg`` and draws, from its trace, foot path, force and
torques of the cycles that the paper shows. What it claims: position errors are all but gone by cycle 5, the force
settles within 5 % of F_d, and CMAC provides the major part of the torque.
"""

import argparse
from pathlib import Path

import numpy as np
import pyarrow as pa
from hydra import compose, initialize_config_dir

from cmacexp.config import config_folder, to_config
from cmacexp.keep import read_traces
from cmacexp.run import run_scenario
from cmacexp.table import as_array

CYCLES = {1: ("#D55E00", "cycle 1, feedback only"), 2: ("#56B4E9", "cycle 2"), 5: ("#009E73", "cycle 5")}
"""Cycles that the paper shows, in the colours of Okabe & Ito 2008."""
JOINT = 1


def run(folder: Path, overrides: list[str]) -> pa.Table:
    """Run the scenario into ``folder``; its trace."""
    with initialize_config_dir(str(config_folder()), version_base="1.3"):
        config = to_config(compose("config", ["scenario=one_leg", "record=trace", *overrides]))
    run_scenario(config, folder)
    return read_traces(folder).legs


def draw(trace: pa.Table, path: Path) -> None:
    """Foot path, contact force and torque of joint 1, cycle by cycle, from a trace."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    cycle = as_array(trace, "cycle")
    columns = {name: as_array(trace, name) for name in trace.column_names if name != "phase"}
    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(13.5, 4.0), layout="constrained")
    first = cycle == 1
    left.plot(1e3 * columns["x_desired"][first], 1e3 * columns["y_desired"][first], "k", lw=1.2, label="desired")
    time = columns["time"][first]
    middle.plot(time, columns["force_desired"][first], "k", lw=1.2, label="desired")
    for number, (colour, name) in CYCLES.items():
        rows = cycle == number
        left.plot(1e3 * columns["x"][rows], 1e3 * columns["y"][rows], color=colour, label=name)
        middle.plot(time, columns["force"][rows], color=colour, label=name)
    last = cycle == max(CYCLES)
    for part, colour in (("feedback", "#D55E00"), ("feedforward", "#0072B2")):
        right.plot(time, columns[f"tau_{part}_{JOINT}"][last], color=colour, label=part)
    left.invert_yaxis()
    left.axhline(500.0, color="#8C6946", lw=0.8, ls="--")
    left.annotate("ground", (left.get_xlim()[0], 500.0), textcoords="offset points", xytext=(4, 4), color="#8C6946")
    left.set(title="foot", xlabel="x forward, mm", ylabel="y down, mm")
    middle.set(title="contact force", xlabel="time in the cycle, s", ylabel="force, N")
    right.set(
        title=f"torque of joint {JOINT}, cycle {max(CYCLES)}", xlabel="time in the cycle, s", ylabel="torque, N m"
    )
    for axes in (left, middle, right):
        axes.legend(fontsize=8, frameon=False)
        axes.spines[["top", "right"]].set_visible(False)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def main() -> None:
    """Run and draw."""
    parser = argparse.ArgumentParser(prog="python -m pipelines.one_leg_learning", description=__doc__)
    parser.add_argument("--folder", type=Path, default=Path("outputs/pipelines/one_leg_learning"))
    parser.add_argument("--figure", type=Path, help="default: one_leg.png in the folder")
    arguments = parser.parse_args()
    trace = run(arguments.folder, [])
    figure = arguments.figure or arguments.folder / "one_leg.png"
    draw(trace, figure)
    error = {k: 1e3 * float(np.sqrt(np.mean(_transfer_error(trace, k) ** 2))) for k in CYCLES}
    print("transfer error of the foot, mm: " + ", ".join(f"cycle {k} {v:.2f}" for k, v in error.items()))
    print(figure)


def _transfer_error(trace: pa.Table, cycle: int) -> np.ndarray:
    rows = (as_array(trace, "cycle") == cycle) & (as_array(trace, "force_desired") == 0.0)
    x, y = (as_array(trace, n)[rows] - as_array(trace, f"{n}_desired")[rows] for n in ("x", "y"))
    return np.hypot(x, y)


if __name__ == "__main__":
    main()
