"""The exported control law in C against the one in Python: bit-identical commands and weights, and its time per step.

Recording sensors store the signals of each step of the Python loop and the resulting command; the C code then gets
the same signals.
"""

import ctypes
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import cmacexp
from benchmarks.c_loop import SAME_BITS, compile_library
from benchmarks.timing import Row, Table, format_time, stopwatch
from cmacexp.addons.export.c_code import write_c
from cmacexp.addons.export.c_law import compute_feet, describe_law
from cmacexp.addons.export.network import keep_rows, list_path_rows, read_final_config, read_learnt
from cmacexp.loop.builtin import make_guard
from cmacexp.loop.driver import Driver
from cmacexp.loop.parts import Loop
from cmacexp.loop.samples import make_samples
from cmacexp.loop.scenario import make_scenario
from cmacexp.loop.stop import RUNNING
from cmacexp.planning import Setup
from cmacexp.plants import Measurement
from cmacexp.plants.drives import ANGLE, DAMPING, STIFFNESS, VELOCITY
from cmacexp.typing import Array

GO2 = ("scenario=robot", "machine=go2", "force_control.load_sharing=dynamic")
RUNS = {
    "one leg": ("scenario=one_leg", "learning=lasting"),
    "quadruped": ("scenario=quadruped", "learning=lasting"),
    "quadruped without a guard": ("scenario=quadruped", "learning=lasting", "learning.guard=none"),
    "Go2, commands of drives": (*GO2, "controller=drives"),
    "Go2, hybrid feedback": GO2,
}
SHORT = ("cycles=4", "record=metrics", "record.weights=true", "warn=false")
SOURCE = Path(__file__).with_name("walk.c")
STEPS, QUICK_STEPS = 1_000_000, 3_000
ROUNDS = 50


class Recorder:
    """Sensors that measure the true state, compute feet from joint angles, and record one cycle.

    Attributes:
        loop: the loop whose commands are recorded; to be set before the first step.
        signals, commands: (N, numbers), N samples of a cycle, in the order of the C interface.
    """

    loop: Loop

    def __init__(self, samples: int, signals: int, commands: int):
        self.signals = np.zeros((samples, signals))
        self.commands = np.zeros((samples, commands))
        self.steps = 0

    def reset(self, setup: Setup) -> None:
        """Store the mechanism, from which feet are computed."""
        self.mechanism = setup.mechanism

    def measure(self, true: Measurement) -> Measurement:
        """Record the signals of a step and the command of the previous step; return the true state."""
        sample = self.steps % len(self.signals)
        if sample > 0:
            self.keep_command(sample - 1)
        foot, velocity = compute_feet(self.mechanism, true.q, true.dq)
        travel = np.zeros(3) if true.travel is None else true.travel
        signals = np.concatenate([true.q, true.dq, true.force, true.body, true.body_rate, travel], axis=None)
        self.signals[sample] = signals[: self.signals.shape[1]]
        self.steps += 1
        return true._replace(foot=foot, velocity=velocity)

    def keep_command(self, sample: int) -> None:
        """Record the last command of the loop as that of ``sample``."""
        torque = self.loop.torques.total
        if self.loop.drives is None:
            self.commands[sample] = torque.ravel()
        else:
            sent = self.loop.drives.command
            parts = [sent[ANGLE], sent[VELOCITY], torque, sent[STIFFNESS], sent[DAMPING]]
            self.commands[sample] = np.concatenate(parts, axis=None)


def build(folder: Path) -> ctypes.CDLL:
    """Compile and load the control law exported to a folder."""
    sources = SOURCE, folder / "cmac_leg.c", folder / "cmac_walk.c"
    loaded = compile_library(sources, *SAME_BITS, f"-I{folder}")
    for name in ("play", "compare_weights", "count_signals", "count_commands", "count_bytes"):
        getattr(loaded, name).restype = ctypes.c_int64
    return loaded


def _at(values: Array) -> ctypes.c_void_p:
    return ctypes.c_void_p(values.ctypes.data)


def compare(name: str, overrides: tuple[str, ...], steps: int, folder: Path) -> Row:
    """Run a scenario in Python, repeat its control law in C, and return the time per step in C.

    Raises:
        SystemExit: the run ended early, or a command or a weight differs in any bit.
    """
    run = cmacexp.run([*overrides, *SHORT], folder / "run")
    write_c(run, folder, law=describe_law(run))
    library = build(folder)
    config = read_final_config(run)
    period = config.steps_per_cycle
    learning = replace(config.learning, start_from=str(run.folder))
    config = replace(config, cycles=-(-steps // period), learning=learning)
    recorder = Recorder(period, library.count_signals(), library.count_commands())
    scenario = make_scenario(config, read_learnt(run), sensors=recorder)
    driver = Driver(scenario, make_guard(scenario))
    recorder.loop = driver.loop
    legs, joints = scenario.setup.mechanism.shape
    samples = make_samples(period, legs, True, joints)
    library.load()
    count = ctypes.c_int64(period)
    wrong = 0
    for _ in range(config.cycles):
        if driver.run(*samples) != RUNNING:
            raise SystemExit(f"{name}: the walk ended at step {driver.taken}")
        recorder.keep_command(period - 1)
        wrong += library.play(_at(recorder.signals), _at(recorder.commands), count)
    params: Any = scenario.feedforward.params  # type: ignore[attr-defined]  # a network
    weights = np.ascontiguousarray(keep_rows(params, list_path_rows(params)).weights)
    wrong_weights = library.compare_weights(_at(weights))
    if wrong or wrong_weights:
        raise SystemExit(
            f"{name}: {wrong} of {driver.taken} commands and {wrong_weights} of {weights.size} weights differ"
        )
    again = stopwatch(lambda: library.play(_at(recorder.signals), _at(recorder.commands), count))
    what = f"{name}, {driver.taken:,} steps with equal bits, {library.count_bytes():,} bytes of state"
    return Row(what, format_time(min(again() for _ in range(ROUNDS)) / period), "", None, "equal")


def tables(quick: bool) -> list[Table]:
    """Return a table with a row for each run of RUNS."""
    rows = []
    for name, overrides in RUNS.items():
        with tempfile.TemporaryDirectory() as folder:
            rows.append(compare(name, overrides, QUICK_STEPS if quick else STEPS, Path(folder)))
    return [Table("The law in C, a step", rows)]
