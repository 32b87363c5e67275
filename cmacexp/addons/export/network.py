"""The network of a stored run, ready for another program: addressing, rows in use, learning rule, learnt weights.

Its test vectors are what the kernels of the project compute, in double or in single precision. Kernels are plain
Python, so that with arrays of float32 they compute in single precision, operation by operation as C does.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cmacexp.cmac.addressing import RECTANGULAR, Address, InputRange, activate, address
from cmacexp.cmac.rules import NEIGHBOURS
from cmacexp.config.component import is_shipped
from cmacexp.config.machine import RobotMachine
from cmacexp.config.schema import NONE, Config
from cmacexp.data.run import Run, read_config
from cmacexp.data.weights import WEIGHTS, load_weights
from cmacexp.errors import BadInput, BadRun, require
from cmacexp.feedforward import CmacFeedforward, CmacOnModel, RadialBasis
from cmacexp.feedforward.kernels import FeedforwardParams, learn, read_sample
from cmacexp.feedforward.network import planned_inputs
from cmacexp.planning import Setup, make_plan
from cmacexp.planning.machine import make_mechanism
from cmacexp.recording.run_view import read_robot_of_run
from cmacexp.typing import Array, Weights

EXPORTED = {"cmac": CmacFeedforward, "cmac_on_model": CmacOnModel, "rbf": RadialBasis}
"""Feedforwards that can be exported, by their options."""
MOST_LEAD = 1000
MIN_STEPS, LEARNING_STEPS = 40, 24
"""Steps of the vectors, and those of them at least that learn."""
MOST_PRODUCTS = 2_000_000
"""Active weights read while single precision is measured, which takes a second or two."""
NetworkFeedforward = CmacFeedforward | CmacOnModel | RadialBasis
Rows = Sequence[Any]
"""(rows,) of each leg: those of the run that are kept, in their new order."""


@dataclass(frozen=True)
class Network:
    """Networks of L legs with J joints over a cycle of N samples."""

    kind: str
    """One of EXPORTED."""
    setup: Setup
    """What it was made of; ``setup.learnt`` is None if the run stored no weights."""
    params: FeedforwardParams
    """Rows are numbered as exported, along the plan and in the weights (L, rows, J)."""
    field: int
    """Receptive field; of other activations than those of a CMAC -1."""
    model_torque: Array | None
    """(N, L, J): torque of a model that is added, N m."""
    inputs: Array
    """(N, L, n): planned; n is 0 if cells are known for one path alone."""
    input_names: Sequence[str] = ()
    addresses: Sequence[Address] = ()
    """How the inputs of each leg are addressed; empty: cells are known for one path alone."""
    places: Sequence[Any] = ()
    """(rows,) of each leg with visited addressing: position of the cell of every row, in order; else empty."""

    @property
    def is_weighted(self) -> bool:
        """Whether activations are not all 1."""
        return self.field != RECTANGULAR


def read_network(run: Run, one_path: bool) -> Network:
    """The network of a run whose classes are all those of the package; raises BadInput or BadRun.

    ``one_path`` keeps the cells of the planned path alone, by sample, instead of the addressing.
    """
    kind, feedforward, setup = _reset(run)
    params, model_torque = feedforward.params, feedforward.model_torque
    cmacs = [] if isinstance(feedforward, RadialBasis) else feedforward.cmacs
    field = cmacs[0].receptive_field if cmacs else -1
    if one_path or not cmacs:
        own = keep_rows(params, list_path_rows(params))
        return Network(kind, setup, own, field, model_torque, np.zeros((*params.cells.shape[:2], 0)))
    ahead = "trains cells of steps to come, which are known for one path alone; add --path"
    require(setup.lead >= -1, "learning.lead", setup.lead, ahead)
    names = setup.config.cmac.inputs
    inputs = np.stack([planned_inputs(setup, i, names) for i in range(len(cmacs))], axis=1)
    kept: Rows = [np.arange(params.weights.shape[1])] * len(cmacs)
    places: Rows = []
    if cmacs[0].visited is not None:
        found = [np.unique(cmac.visited.positions, return_index=True) for cmac in cmacs if cmac.visited is not None]
        places, kept = zip(*found, strict=True)
    addresses = [cmac.address for cmac in cmacs]
    return Network(kind, setup, keep_rows(params, kept), field, model_torque, inputs, names, addresses, places)


def require_exportable(run: Run) -> str:
    """The kind of its network, before anything that a run names is imported; raises BadInput."""
    plain = run.config
    reason = "must be of cmacexp: a custom component is not imported here"
    for group in ("plant", "sensors", "controller"):
        target = plain[group]["_target_"]
        require(is_shipped(target), f"{group}._target_", target, reason)
    target = plain["feedforward"]["_target_"]
    for kind, each in EXPORTED.items():
        if target in (f"cmacexp.feedforward.{each.__name__}", f"{each.__module__}.{each.__name__}"):
            return kind
    raise BadInput("feedforward._target_", target, f"cannot be exported as C; what can is {', '.join(EXPORTED)}")


def read_final_config(run: Run) -> Config:
    """The config, with lead and rate as they were at the end of the run; raises BadInput or BadRun."""
    config = read_config(run)
    if isinstance(config.machine, RobotMachine):
        read_robot_of_run(run, config.machine)
    lead, rate = (run.manifest[f"learning_{name}"] for name in ("lead", "rate"))
    if lead is None or rate is None or not -MOST_LEAD <= lead <= MOST_LEAD or not 0 < rate < 2:
        raise BadRun(f"{run.folder}: learning_lead={lead} and learning_rate={rate} are none of a run; run it again")
    return replace(config, learning=replace(config.learning, lead=int(lead), rate=float(rate), start_from=None))


def read_learnt(run: Run) -> Weights | None:
    """What the run stored of its network; None if it kept nothing. Raises BadRun."""
    if WEIGHTS not in run.manifest["files"]:
        BadRun.unless(
            run.config["learning"].get("start_from") is None,
            f"{run.folder}: started from weights, but stored none; run it with record.weights=true",
        )
        return None
    return load_weights(run.folder)


def _reset(run: Run) -> tuple[str, NetworkFeedforward, Setup]:
    """The kind of the network of a run, the feedforward along its plan, and what it was made of."""
    kind = require_exportable(run)
    config = read_final_config(run)
    learnt = read_learnt(run)
    mechanism = make_mechanism(config.machine)
    plan = make_plan(config.nominal, mechanism, True)
    lead, rate = config.learning.lead, config.learning.rate
    config = replace(config, learning=replace(config.learning, guard=NONE))  # which would spend time on its rate
    setup = Setup(config.nominal, mechanism, plan, np.zeros(mechanism.shape), learnt, int(lead), float(rate))
    feedforward: Any = EXPORTED[kind](config.feedforward)
    try:
        feedforward.reset(setup)
        _require_fitting(feedforward)
    except (BadInput, LookupError, TypeError, ValueError) as error:
        if learnt is None or (isinstance(error, BadInput) and error.key != "learning.start_from"):
            raise
        raise BadRun(f"{run.folder / WEIGHTS}: does not fit the config of its run ({error}); run it again") from None
    reason = "cannot be exported: it trains the cells of many steps at once; any other rule can"
    require(feedforward.params.learning.rule.teaches != NEIGHBOURS, "learning.rule", config.learning.rule, reason)
    return kind, feedforward, setup


def _require_fitting(feedforward: NetworkFeedforward) -> None:
    """Require finite weights and a row for every cell, since the file may hold anything; raises ValueError."""
    params, rows = feedforward.params, feedforward.params.weights.shape[1]
    ranges = feedforward.learnt()["ranges"]
    is_finite = all(np.isfinite(each).all() for each in (params.weights, params.activation, ranges))
    if not is_finite or params.cells.max() >= rows:
        raise ValueError("not all of it is finite, or cells have no row")


def list_path_rows(params: FeedforwardParams) -> Rows:
    """(rows,) of each leg that the planned path uses, in order."""
    return [np.unique(params.cells[:, i]) for i in range(params.cells.shape[1])]


def keep_rows(params: FeedforwardParams, kept: Rows) -> FeedforwardParams:
    """``params`` with the rows of each leg in another order, and no others; short legs end with rows of zeros."""
    most = max(map(len, kept))
    weights, cells = np.zeros((len(kept), most, params.weights.shape[2])), np.empty_like(params.cells)
    for i, rows in enumerate(kept):
        weights[i, : len(rows)] = params.weights[i, rows]
        number = np.full(params.weights.shape[1], most)
        number[rows] = np.arange(len(rows))
        cells[:, i] = number[params.cells[:, i]]
    return params._replace(weights=weights, cells=cells)


def checksum(weights: Array) -> int:
    """Sum over the weights of their bits times 2 k + 1, k their number from 0, modulo 2^64."""
    bits = np.ascontiguousarray(weights).view(np.uint64 if weights.itemsize == 8 else np.uint32).ravel()
    factors = 2 * np.arange(bits.size, dtype=np.uint64) + np.uint64(1)
    return int((bits.astype(np.uint64) * factors).sum(dtype=np.uint64))


def _find_cells(network: Network, inputs: Array, real: Any) -> tuple[Any, Array]:
    """Rows and activations (K, L, C) of ``inputs`` (K, L, n) in precision ``real``, or of the plan."""
    if not network.addresses:
        activation = network.params.activation if network.is_weighted else np.ones(network.params.cells.shape)
        return network.params.cells, activation.astype(real)
    shape = (*inputs.shape[:2], network.params.cells.shape[2])
    cells, activation = np.empty(shape, dtype=np.int64), np.ones(shape, dtype=real)
    for i, params in enumerate(network.addresses):
        ranges = InputRange(params.ranges.low.astype(real), params.ranges.high.astype(real))
        # Of 16 bits, because the sum of a float32 and an integer of more is a float64.
        params = params._replace(ranges=ranges, displacement=params.displacement.astype(np.int16))
        found = np.empty((shape[2], len(inputs)), dtype=np.uint64)
        address(params, inputs[:, i].T, found)  # type: ignore[arg-type]  # of 64 bits: positions
        cells[:, i] = found.T
        if network.places:  # the row beyond the last of a cell that has none
            places = network.places[i]
            place = np.searchsorted(places, found.T)
            has_row = places[np.minimum(place, len(places) - 1)] == found.T
            cells[:, i] = np.where(has_row, place, network.params.weights.shape[1])
        if network.is_weighted:
            for k in range(len(inputs)):
                activate(params, network.field, inputs[k, i], activation[k, i])
    return cells, activation


def run_steps(network: Network, inputs: Array, errors: Array, real: Any) -> tuple[Array, Array]:
    """Torque (K, L, J) and weights (L, rows, J) after K steps, from the learnt weights and the first sample on, N m.

    Takes inputs (K, L, n) and learning errors (K, L, J); ``real`` is ``np.float64`` or ``np.float32``.
    """
    legs, rows, joints = network.params.weights.shape
    weights = np.zeros((legs, rows + 1, joints), dtype=real)
    weights[:, :rows] = network.params.weights
    cells, activation = _find_cells(network, inputs.astype(real), real)
    how, given = network.params.learning, errors.astype(real)
    how = how._replace(rate=how.rate.astype(real), rule=how.rule._replace(strength=real(how.rule.strength)))
    params = network.params._replace(cells=cells, activation=activation, weights=weights, learning=how)
    samples, steps = len(network.params.cells), len(cells)
    model_torque = None if network.model_torque is None else network.model_torque.astype(real)
    torque = np.empty(given.shape, dtype=real)
    for k in range(len(given)):
        cycles, back = k // samples, k - 1 - how.lead
        for i in range(legs):
            if back >= 0 or not network.addresses:
                learn(params, i, how.start_step + cycles * steps, back % steps, given[k, i])
                weights[i, rows] = 0.0  # of cells without a row
            read_sample(params, i, k % steps, torque[k, i])
            if model_torque is not None:
                torque[k, i] += model_torque[k % samples, i]
    return torque, weights[:, :rows]


def _draw_steps(network: Network) -> tuple[Array, Array]:
    """Inputs (K, L, n), planned, then some in their ranges and beyond, and learning errors (K, L, J), N m."""
    rng, (legs, _, joints) = np.random.default_rng(1997), network.params.weights.shape
    steps = max(MIN_STEPS, network.params.learning.lead + LEARNING_STEPS)
    inputs = network.inputs[np.arange(steps) % len(network.inputs)].copy()
    if network.addresses and not network.places:  # else cells without a row would learn in Python alone
        elsewhere = steps // 3
        for i, params in enumerate(network.addresses):
            low, high = params.ranges
            inputs[-elsewhere:, i] = low + (high - low) * rng.uniform(-0.1, 1.1, (elsewhere, len(low)))
    return inputs, rng.uniform(-1.0, 1.0, (steps, legs, joints))


def _run_cycle(network: Network) -> tuple[Array, Array]:
    """Torques of a cycle of the plan, as far as that is quick, in double and in single precision, N m."""
    (samples, legs, layers), joints = network.params.cells.shape, network.params.weights.shape[2]
    steps = max(1, min(samples, MOST_PRODUCTS // (legs * layers * joints)))
    errors = np.random.default_rng(1997).uniform(-1.0, 1.0, (steps, legs, joints))
    double, single = (run_steps(network, network.inputs[:steps], errors, real) for real in (np.float64, np.float32))
    return double[0], single[0]


def make_vectors(network: Network, is_single: bool) -> dict[str, Any]:
    """What the templates say of some steps: inputs, learning errors, torques in double precision, a row each.

    With checksums of the weights before and after the steps, in the precision of the code. In single precision there
    is also its error, of these steps and of a cycle, and the largest torque of that cycle, N m.
    """
    inputs, errors = _draw_steps(network)
    torque, weights = run_steps(network, inputs, errors, np.float64)
    found, steps = dict[str, Any](), len(errors)
    real: Any = np.float32 if is_single else np.float64
    if is_single:
        rounded, weights = run_steps(network, inputs, errors, real)
        double, single = _run_cycle(network)
        off = max(np.abs(torque - rounded).max(), np.abs(double - single).max())
        largest = np.abs(double).max()
        found = {"error": f"{1.1 * off:.1e}", "largest": f"{largest:.2g}", "error_steps": steps + len(double)}
    return found | {
        "steps": steps,
        "vector_inputs": inputs.astype(real).reshape(steps, -1),
        "vector_errors": errors.astype(real).reshape(steps, -1),
        "vector_torque": torque.reshape(steps, -1),
        "loaded": checksum(network.params.weights.astype(real)),
        "learnt_sum": checksum(weights),
    }
