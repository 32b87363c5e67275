"""The network of a stored run for export: addressing, rows in use, learning rule, learnt weights.

The kernels of the project compute its test vectors, in double or single precision. Kernels are plain Python: with
arrays of float32 they compute in single precision, operation by operation as C does.
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
"""Classes of feedforwards that can be exported, by option."""
MOST_LEAD = 1000
"""Largest lead or advance of a run that is exported, samples."""
MIN_STEPS = 40
"""Smallest number of steps of the test vectors."""
LEARNING_STEPS = 24
"""Smallest number of these steps that learn."""
MOST_PRODUCTS = 2_000_000
"""Active weights read to measure the error of single precision: a second or two."""
NetworkFeedforward = CmacFeedforward | CmacOnModel | RadialBasis
Rows = Sequence[Any]
"""(rows,) for each leg: indices of the kept rows, in their new order."""


@dataclass(frozen=True)
class Network:
    """Networks of L legs with J joints, over a cycle of N samples."""

    kind: str
    """Key of EXPORTED."""
    setup: Setup
    """Setup of the network; ``setup.learnt`` is None if the run stored no weights."""
    params: FeedforwardParams
    """Parameters with rows as exported, along the plan and in the weights (L, rows, J), N m."""
    field: int
    """Receptive field of a CMAC; -1 for other activations."""
    model_torque: Array | None
    """(N, L, J): model torque that is added, N m; None: no model."""
    inputs: Array
    """(N, L, n): planned inputs; n is 0 if cells are known only for the planned path."""
    input_names: Sequence[str] = ()
    """Names of the inputs, as in ``cmac.inputs``."""
    addresses: Sequence[Address] = ()
    """Addressing of each leg; empty if cells are known only for the planned path."""
    visited: Sequence[Any] = ()
    """(rows,) for each leg with visited addressing: number of the cell of each row, ascending; else empty."""

    @property
    def is_weighted(self) -> bool:
        """True if activations differ from 1."""
        return self.field != RECTANGULAR


def read_network(run: Run, one_path: bool) -> Network:
    """Read the network of a run; raises BadInput if it cannot be exported, BadRun if files are damaged.

    With ``one_path`` the result has the cells of the planned path, by sample, instead of the addressing.
    """
    kind, feedforward, setup = _reset(run)
    params = feedforward.params
    cmacs = [] if isinstance(feedforward, RadialBasis) else feedforward.cmacs
    field = cmacs[0].receptive_field if cmacs else -1
    if one_path or not cmacs:
        params = keep_rows(params, list_path_rows(params))
        return Network(kind, setup, params, field, feedforward.model_torque, np.zeros((*params.cells.shape[:2], 0)))
    require(
        setup.lead >= -1,
        "learning.lead",
        setup.lead,
        "trains cells of later steps, which are known only on the planned path; add --path",
    )
    names = setup.config.cmac.inputs
    inputs = np.stack([planned_inputs(setup, i, names) for i in range(len(cmacs))], axis=1)
    kept: Rows = [np.arange(params.weights.shape[1])] * len(cmacs)
    visited: Rows = []
    if cmacs[0].visited is not None:
        cells = [np.unique(cmac.visited.positions, return_index=True) for cmac in cmacs if cmac.visited is not None]
        visited, kept = zip(*cells, strict=True)
    addresses = [cmac.address for cmac in cmacs]
    params = keep_rows(params, kept)
    return Network(kind, setup, params, field, feedforward.model_torque, inputs, names, addresses, visited)


def require_exportable(run: Run) -> str:
    """Return the key in EXPORTED of the network of a run, before any class is imported; raises BadInput."""
    for group in ("plant", "sensors", "controller"):
        target = run.config[group]["_target_"]
        require(
            is_shipped(target),
            f"{group}._target_",
            target,
            "must be of cmacexp: a custom component is not imported here",
        )
    target = run.config["feedforward"]["_target_"]
    for kind, exported in EXPORTED.items():
        if target in (f"cmacexp.feedforward.{exported.__name__}", f"{exported.__module__}.{exported.__name__}"):
            return kind
    raise BadInput("feedforward._target_", target, f"cannot be exported as C; what can is {', '.join(EXPORTED)}")


def read_final_config(run: Run) -> Config:
    """Read the config of a run, with lead and rate as at its end; raises BadInput or BadRun."""
    config = read_config(run)
    if isinstance(config.machine, RobotMachine):
        read_robot_of_run(run, config.machine)
    lead, rate = (run.manifest[f"learning_{name}"] for name in ("lead", "rate"))
    if lead is None or rate is None or not -MOST_LEAD <= lead <= MOST_LEAD or not 0 < rate < 2:
        raise BadRun(f"{run.folder}: learning_lead={lead} and learning_rate={rate} are none of a run; run it again")
    return replace(config, learning=replace(config.learning, lead=int(lead), rate=float(rate), start_from=None))


def read_learnt(run: Run) -> Weights | None:
    """Read the weights that a run stored, or return None if it stored none; raises BadRun."""
    if WEIGHTS not in run.manifest["files"]:
        BadRun.unless(
            run.config["learning"].get("start_from") is None,
            f"{run.folder}: started from weights, but stored none; run it with record.weights=true",
        )
        return None
    return load_weights(run.folder)


def _reset(run: Run) -> tuple[str, NetworkFeedforward, Setup]:
    """Rebuild the feedforward of a run along its plan; return its key in EXPORTED, it, and its setup.

    Raises BadInput if it cannot be exported, BadRun if the stored weights do not fit.
    """
    kind = require_exportable(run)
    config = read_final_config(run)
    learnt = read_learnt(run)
    mechanism = make_mechanism(config.machine)
    plan = make_plan(config.nominal, mechanism, True)
    learning = config.learning
    config = replace(config, learning=replace(learning, guard=NONE))  # a guard would cost time for its rate
    lead = int(learning.lead)
    setup = Setup(config.nominal, mechanism, plan, np.zeros(mechanism.shape), learnt, lead, float(learning.rate))
    feedforward: Any = EXPORTED[kind](config.feedforward)
    try:
        feedforward.reset(setup)
        _require_fitting(feedforward)
    except (BadInput, LookupError, TypeError, ValueError) as error:
        if learnt is None or (isinstance(error, BadInput) and error.key != "learning.start_from"):
            raise
        raise BadRun(f"{run.folder / WEIGHTS}: does not fit the config of its run ({error}); run it again") from None
    require(
        feedforward.params.learning.rule.teaches != NEIGHBOURS,
        "learning.rule",
        config.learning.rule,
        "cannot be exported: it trains the cells of many steps at once; any other rule can",
    )
    return kind, feedforward, setup


def _require_fitting(feedforward: NetworkFeedforward) -> None:
    """Raise ValueError unless weights are finite and every cell has a row, since the file may contain anything."""
    params = feedforward.params
    arrays = (params.weights, params.activation, feedforward.learnt()["ranges"])
    if not all(np.isfinite(array).all() for array in arrays) or params.cells.max() >= params.weights.shape[1]:
        raise ValueError("not all of it is finite, or cells have no row")


def list_path_rows(params: FeedforwardParams) -> Rows:
    """List the rows that the planned path of each leg uses, (rows,), ascending."""
    return [np.unique(params.cells[:, i]) for i in range(params.cells.shape[1])]


def keep_rows(params: FeedforwardParams, kept: Rows) -> FeedforwardParams:
    """Return ``params`` with only the ``kept`` rows of each leg, renumbered, and padded with rows of zeros."""
    most = max(map(len, kept))
    weights = np.zeros((len(kept), most, params.weights.shape[2]))
    cells = np.empty_like(params.cells)
    for i, rows in enumerate(kept):
        weights[i, : len(rows)] = params.weights[i, rows]
        number = np.full(params.weights.shape[1], most)
        number[rows] = np.arange(len(rows))
        cells[:, i] = number[params.cells[:, i]]
    return params._replace(weights=weights, cells=cells)


def checksum(weights: Array) -> int:
    """Compute a checksum: sum over weight k = 0, 1, ... of its bits times 2 k + 1, modulo 2^64."""
    bits = np.ascontiguousarray(weights).view(np.uint64 if weights.itemsize == 8 else np.uint32).ravel()
    factors = 2 * np.arange(bits.size, dtype=np.uint64) + np.uint64(1)
    return int((bits.astype(np.uint64) * factors).sum(dtype=np.uint64))


def _find_cells(network: Network, inputs: Array, real: Any) -> tuple[Any, Array]:
    """Compute rows and activations (K, L, C) of ``inputs`` (K, L, n) in precision ``real``.

    A network without addressing gives those of the plan instead.
    """
    if not network.addresses:
        activation = network.params.activation if network.is_weighted else np.ones(network.params.cells.shape)
        return network.params.cells, activation.astype(real)
    shape = (*inputs.shape[:2], network.params.cells.shape[2])
    cells = np.empty(shape, dtype=np.int64)
    activation = np.ones(shape, dtype=real)
    for i, params in enumerate(network.addresses):
        ranges = InputRange(params.ranges.low.astype(real), params.ranges.high.astype(real))
        # int16, because numpy adds a float32 and a wider integer in float64.
        params = params._replace(ranges=ranges, displacement=params.displacement.astype(np.int16))
        numbers = np.empty((shape[2], len(inputs)), dtype=np.uint64)
        address(params, inputs[:, i].T, numbers)  # type: ignore[arg-type]  # cell numbers need 64 bits
        cells[:, i] = numbers.T
        if network.visited:  # cells without a row get the row after the last
            visited = network.visited[i]
            rows = np.searchsorted(visited, numbers.T)
            has_row = visited[np.minimum(rows, len(visited) - 1)] == numbers.T
            cells[:, i] = np.where(has_row, rows, network.params.weights.shape[1])
        if network.is_weighted:
            for k in range(len(inputs)):
                activate(params, network.field, inputs[k, i], activation[k, i])
    return cells, activation


def run_steps(network: Network, inputs: Array, errors: Array, real: Any) -> tuple[Array, Array]:
    """Run K steps from the learnt weights and the first sample; return torques and final weights, N m.

    Takes ``inputs`` (K, L, n) and learning ``errors`` (K, L, J), N m; ``real`` is ``np.float64`` or ``np.float32``.
    Returns torques (K, L, J) and weights (L, rows, J).
    """
    legs, rows, joints = network.params.weights.shape
    weights = np.zeros((legs, rows + 1, joints), dtype=real)
    weights[:, :rows] = network.params.weights
    cells, activation = _find_cells(network, inputs.astype(real), real)
    learning = network.params.learning
    learning = learning._replace(
        rate=learning.rate.astype(real),
        rule=learning.rule._replace(strength=real(learning.rule.strength)),
    )
    params = network.params._replace(cells=cells, activation=activation, weights=weights, learning=learning)
    samples, steps = len(network.params.cells), len(cells)
    errors = errors.astype(real)
    model_torque = None if network.model_torque is None else network.model_torque.astype(real)
    torque = np.empty(errors.shape, dtype=real)
    for k in range(len(errors)):
        learning_step = learning.start_step + k // samples * steps
        trained = k - 1 - learning.lead
        for i in range(legs):
            if trained >= 0 or not network.addresses:
                learn(params, i, learning_step, trained % steps, errors[k, i])
                weights[i, rows] = 0.0  # cells without a row learn nothing
            read_sample(params, i, k % steps, torque[k, i])
            if model_torque is not None:
                torque[k, i] += model_torque[k % samples, i]
    return torque, weights[:, :rows]


def _draw_steps(network: Network) -> tuple[Array, Array]:
    """Draw the test inputs (K, L, n), planned ones and then random ones, and learning errors (K, L, J), N m."""
    rng = np.random.default_rng(1997)
    legs, _, joints = network.params.weights.shape
    steps = max(MIN_STEPS, network.params.learning.lead + LEARNING_STEPS)
    inputs = network.inputs[np.arange(steps) % len(network.inputs)].copy()
    if network.addresses and not network.visited:  # unvisited cells would learn in Python only
        elsewhere = steps // 3
        for i, params in enumerate(network.addresses):
            low, high = params.ranges
            inputs[-elsewhere:, i] = low + (high - low) * rng.uniform(-0.1, 1.1, (elsewhere, len(low)))
    return inputs, rng.uniform(-1.0, 1.0, (steps, legs, joints))


def _run_cycle(network: Network) -> tuple[Array, Array]:
    """Compute the torques of a planned cycle, shortened if slow, in double and in single precision, N m."""
    samples, legs, layers = network.params.cells.shape
    joints = network.params.weights.shape[2]
    steps = max(1, min(samples, MOST_PRODUCTS // (legs * layers * joints)))
    errors = np.random.default_rng(1997).uniform(-1.0, 1.0, (steps, legs, joints))
    double, single = (run_steps(network, network.inputs[:steps], errors, real) for real in (np.float64, np.float32))
    return double[0], single[0]


def make_vectors(network: Network, is_single: bool) -> dict[str, Any]:
    """Return the template variables of the test.

    These are inputs, learning errors, and torques in double precision, one row per step. Includes checksums of the
    weights before and after the steps, in the precision of the code; in single precision also its error over these
    steps and a cycle, and the largest torque of that cycle, N m.
    """
    inputs, errors = _draw_steps(network)
    torque, weights = run_steps(network, inputs, errors, np.float64)
    steps = len(errors)
    precision: dict[str, Any] = {}
    real: Any = np.float32 if is_single else np.float64
    if is_single:
        rounded, weights = run_steps(network, inputs, errors, real)
        double, single = _run_cycle(network)
        largest_error = max(np.abs(torque - rounded).max(), np.abs(double - single).max())
        precision = {
            "error": f"{1.1 * largest_error:.1e}",
            "largest": f"{np.abs(double).max():.2g}",
            "error_steps": steps + len(double),
        }
    return precision | {
        "steps": steps,
        "vector_inputs": inputs.astype(real).reshape(steps, -1),
        "vector_errors": errors.astype(real).reshape(steps, -1),
        "vector_torque": torque.reshape(steps, -1),
        "loaded": checksum(network.params.weights.astype(real)),
        "learnt_sum": checksum(weights),
    }
