"""The closed loop of one leg in plain C (``one_leg.c``): compile it and run it with the parameters of a scenario."""

import ctypes
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from cmacexp.config.schema import NONE
from cmacexp.control import HybridController
from cmacexp.feedforward import CmacFeedforward
from cmacexp.feedforward.network import planned_inputs as of_leg
from cmacexp.loop.scenario import Scenario
from cmacexp.models.mechanism import LEGS_ON_STAND
from cmacexp.plants import AnalyticPlant
from cmacexp.typing import Array

COLUMNS = (
    "x_reference", "y_reference", "x", "y", "vx", "vy", "q1", "q2", "dq1", "dq2", "force", "force_measured",
    "tau_feedback_1", "tau_feedback_2", "tau_feedforward_1", "tau_feedforward_2",
)  # fmt: skip
"""Signals that ``one_leg.c`` writes in each step, in the order of its columns."""
SOURCE = Path(__file__).with_name("one_leg.c")
SAME_BITS = ["-O2", "-ffp-contract=off"]
"""Compiler flags for results bit-identical to Python: a fused multiply-add would change the last bits."""
FASTEST = ["-O3", "-march=native", "-ffast-math"]
"""Compiler flags for speed; results may round differently."""
NUMBERS = (
    "length_1", "length_2", "mass_1", "mass_2", "hip_height", "stiffness", "step",
    "position_gain", "velocity_gain", "elasticity", "admittance", "b0", "b1", "a1", "torque_limit", "rate",
)  # fmt: skip
COUNTS = ("period", "start_step", "resolution_elements", "rows", "seed", "lead")
TABLES = ("support", "reference", "inputs", "low", "high", "shift", "weights")
MOST_LEAD = 30
"""Largest lead that one_leg.c supports, samples."""


class CLaw(ctypes.Structure):
    """Parameters of the control loop: ``Law`` of one_leg.c."""

    _fields_ = [
        *((name, ctypes.c_double) for name in NUMBERS),
        *((name, ctypes.c_int64) for name in COUNTS),
        *((name, ctypes.c_void_p) for name in TABLES),
    ]


class CState(ctypes.Structure):
    """State of leg and learning: ``State`` of one_leg.c."""

    _fields_ = [
        *((name, ctypes.c_double * 2) for name in ("q", "dq", "foot", "velocity")),
        ("force", ctypes.c_double),
        *((name, ctypes.c_double * 2) for name in ("error", "output", "learning_error")),
        ("taken", ctypes.c_int64),
    ]


def compiler() -> str | None:
    """Return the path of a C compiler on this computer; None if there is none."""
    return shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")


def compile_library(sources: Iterable[Path], *options: str) -> ctypes.CDLL:
    """Compile C sources to a shared library with these compiler options, and load it.

    Raises:
        CalledProcessError: the compiler failed.
    """
    compiler_path = compiler()
    assert compiler_path is not None
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / "library.so"
        subprocess.run(
            [compiler_path, *options, "-shared", "-fPIC", *map(str, sources), "-o", str(library), "-lm"], check=True
        )
        return ctypes.CDLL(str(library))


def build(layers: int, inputs: int) -> ctypes.CDLL:
    """Compile ``one_leg.c`` for a CMAC with ``layers`` layers and ``inputs`` inputs, optimised for speed."""
    loaded = compile_library([SOURCE], *FASTEST, f"-DLAYERS={layers}", f"-DINPUTS={inputs}")
    loaded.one_leg.restype = ctypes.c_int64
    return loaded


def planned_inputs(scenario: Scenario) -> Array:
    """Return the planned inputs (N, n) of the CMAC of the first leg: N samples of a cycle, n inputs."""
    return np.ascontiguousarray(of_leg(scenario.setup, 0, scenario.setup.config.cmac.inputs))


def make_tables(scenario: Scenario) -> dict[str, np.ndarray]:
    """Return the arrays that ``Law`` points to for a fresh scenario, keyed by the names in TABLES."""
    plan = scenario.setup.plan
    address = scenario.feedforward.cmacs[0].address
    position, velocity, *forces, _ = (values[:, :, 0] for values in plan.reference)
    tables = {
        "support": plan.support[:, 0].astype(np.uint8),
        "reference": np.concatenate([position, velocity, np.stack(forces, axis=-1)], axis=-1),
        "inputs": planned_inputs(scenario),
        "low": address.ranges.low,
        "high": address.ranges.high,
        "shift": address.displacement.astype(np.int64),
        "weights": np.zeros((address.rows, 2)),
    }
    return {name: np.ascontiguousarray(table) for name, table in tables.items()}


def make_law(scenario: Scenario, tables: dict[str, np.ndarray]) -> CLaw:
    """Return ``Law`` for a fresh scenario, with pointers to ``tables``, which must outlive it."""
    config = scenario.setup.config
    plan = scenario.setup.plan
    address = scenario.feedforward.cmacs[0].address
    leg = config.machine.leg
    gains = scenario.controller.params.gains
    lead = scenario.controller.params.lead
    numbers = (
        leg.length_1, leg.length_2, leg.mass_1, leg.mass_2, config.machine.hip_height, config.terrain.stiffness,
        config.sampling_period, gains.position_gain, gains.velocity_gain, gains.elasticity,
        gains.admittance, lead.b0, lead.b1, lead.a1, config.actuator.limit, scenario.setup.rate,
    )  # fmt: skip
    counts = (
        len(plan.support), plan.start_step, address.resolution_elements, address.rows, address.seed,
        scenario.setup.lead,
    )  # fmt: skip
    return CLaw(*numbers, *counts, *(tables[name].ctypes.data for name in TABLES))


def make_state(scenario: Scenario) -> CState:
    """Return ``State`` at the first step of a fresh scenario."""
    state = CState(force=scenario.first.force[0])
    for name in ("q", "dq", "foot", "velocity"):
        setattr(state, name, tuple(getattr(scenario.first, name)[0]))
    return state


def run_in_c(library: ctypes.CDLL, scenario: Scenario) -> tuple[Array, float]:
    """Run a fresh ``scenario=one_leg`` from its first step to its last in C.

    Returns:
        Samples (steps, columns) in the order of COLUMNS, SI units, and the time spent in the loop, s.
    """
    config = scenario.setup.config
    plant = scenario.plant
    assert isinstance(plant, AnalyticPlant)
    assert isinstance(scenario.controller, HybridController)
    assert isinstance(scenario.feedforward, CmacFeedforward)
    assert (scenario.setup.mechanism.kind, config.force_control.method) == (LEGS_ON_STAND, "combined")
    assert (plant.config.substeps, config.terrain.patch_spread) == (1, 0.0)
    assert (config.actuator.lag, config.actuator.delay, config.learning.guard) == (0.0, 0, NONE)
    assert scenario.setup.lead <= MOST_LEAD
    tables = make_tables(scenario)
    params = make_law(scenario, tables)
    state = make_state(scenario)
    samples = np.full((config.cycles * config.steps_per_cycle, len(COLUMNS)), np.nan)
    output = (ctypes.c_int64(len(samples)), ctypes.c_void_p(samples.ctypes.data))
    began = time.perf_counter()
    steps = library.one_leg(ctypes.byref(params), ctypes.byref(state), *output)
    return samples[:steps], time.perf_counter() - began
