"""Time per sample of CMAC predict and update with 2, 4 and 6 inputs: in a compiled loop, from Python, in batches."""

from collections.abc import Callable

import numpy as np

from benchmarks.c_loop import planned_inputs
from benchmarks.peers import NumpyCmac, Peer, installed
from benchmarks.timing import Row, Table, compared, in_turn, ratio, stopwatch
from cmacexp.cmac.addressing import Address, InputRange, address, spanning
from cmacexp.cmac.memory import read, train
from cmacexp.cmac.network import Cmac
from cmacexp.config.compose import compose_config
from cmacexp.jit.compiler import program
from cmacexp.loop.scenario import make_scenario
from cmacexp.typing import Array, Cells

INPUTS = {2: "[angle]", 4: "[angle,velocity]", 6: "[angle,velocity,acceleration]"}
BATCH = 10_000
FEW = 200
"""Samples per round where Python processes them one by one."""
PASSES = 50
"""Cycles of the planned path per round."""
RATE = 0.2


@program
def planned_loop(weights: Array, cells: Cells, error: Array, rate: float, output: Array, passes: int) -> None:
    """Predict and update along a path whose active cells (N, C) were computed beforehand."""
    for _ in range(passes):
        for k in range(cells.shape[0]):
            read(weights, cells[k], output)
            train(weights, cells[k], error[k], rate)


@program
def hashed_loop(
    params: Address, inputs: Array, row: Cells, weights: Array, error: Array, rate: float, output: Array, passes: int
) -> None:
    """Predict and update along inputs (N, n); hash the active cells of each sample into ``row`` (C,)."""
    for _ in range(passes):
        for k in range(inputs.shape[0]):
            address(params, inputs[k], row)
            read(weights, row, output)
            train(weights, row, error[k], rate)


def per_sample(work: Callable[[], object], samples: int) -> Callable[[], float]:
    """Return a worker that does ``work`` on ``samples`` samples and returns its time per sample, s."""
    timed = stopwatch(work)
    return lambda: timed() / samples


def inside(inputs: int, rounds: int) -> list[Row]:
    """Time predict and update per sample inside a compiled loop, on the planned path of one leg."""
    config = compose_config(["scenario=one_leg", f"cmac.inputs={INPUTS[inputs]}"])
    path = planned_inputs(make_scenario(config))
    cmac = Cmac.from_config(config.cmac, spanning(path, config.cmac.range_factor))
    cells = cmac.cells(path)
    error = np.random.default_rng(0).normal(size=(len(path), 2))
    output = np.zeros(2)
    row = np.zeros(cmac.layers, dtype=np.uint32)
    samples = PASSES * len(path)
    few = NumpyCmac(cmac.address, cmac.weights, RATE)
    workers = {
        "planned": per_sample(lambda: planned_loop(cmac.weights, cells, error, RATE, output, PASSES), samples),
        "hashed": per_sample(
            lambda: hashed_loop(cmac.address, path, row, cmac.weights, error, RATE, output, PASSES), samples
        ),
        "numpy": per_sample(lambda: [few.step(path[k], error[k]) for k in range(FEW)], FEW),
    }
    times = in_turn(workers, rounds)
    goals = ("0.1 us", "0.4 us") if inputs == 6 else ("", "")
    return [
        compared(times, f"{inputs} inputs, cells planned", "planned", "hashed", "cells hashed", goals[0]),
        compared(times, f"{inputs} inputs, cells hashed", "hashed", "numpy", "NumPy, one by one", goals[1]),
    ]


def _one_by_one(peer: Peer, x: Array, error: Array) -> Callable[[], float]:
    return per_sample(lambda: [peer.step(x[k], error[k]) for k in range(FEW)], FEW)


def outside(inputs: int, rounds: int) -> list[Row]:
    """Time predict and update from Python at random inputs, in a batch and singly, against NumPy and tile coders."""
    rng = np.random.default_rng(1)
    ranges = InputRange(-np.ones(inputs), np.ones(inputs))
    cmac = Cmac.from_config(compose_config(["scenario=one_leg"]).cmac, ranges)
    x = rng.uniform(-1.0, 1.0, size=(BATCH, inputs))
    error = rng.normal(size=(BATCH, 2))
    plain = NumpyCmac(cmac.address, cmac.weights, RATE)
    peers = installed(cmac.address, RATE)
    assert (plain.cells(x) == cmac.cells(x)).all()

    def use(samples: slice | int) -> None:
        cmac.predict(x[samples])
        cmac.update(x[samples], error[samples], RATE)

    workers = {
        "batch": per_sample(lambda: use(slice(0, BATCH)), BATCH),
        "single": per_sample(lambda: [use(k) for k in range(FEW)], FEW),
        "NumPy batch": per_sample(lambda: plain.batch(x, error), BATCH),
        "NumPy": _one_by_one(plain, x, error),
        **{name: _one_by_one(peer, x, error) for name, peer in peers.items()},
    }
    times = in_turn(workers, rounds)
    fastest = max(peers, key=lambda name: ratio(times, "batch", name), default="")
    batch = f"{inputs} inputs, batch of {BATCH}"
    return [
        compared(times, batch, "batch", "NumPy batch", "NumPy, batch"),
        *(compared(times, batch, "batch", name, name, "0.1" if name == fastest else "") for name in peers),
        *(compared(times, f"{inputs} inputs, single", "single", name, name) for name in ("NumPy", *peers)),
    ]


def tables(quick: bool) -> list[Table]:
    """Run the benchmarks of this file and return their tables."""
    rounds = 5 if quick else 21
    about = "32 layers, 2 outputs, 1 MB hashed; predict and update, a sample"
    compiled = [row for n in INPUTS for row in inside(n, rounds)]
    python = [row for n in INPUTS for row in outside(n, rounds)]
    return [
        Table(f"CMAC inside a compiled loop ({about})", compiled),
        Table(
            f"CMAC from Python ({about})",
            python,
            "Peers have no batches: they go sample by sample. They find the cells of a sample once for both, this "
            "project's `predict` and `update` find them twice.",
        ),
    ]
