"""The network of a stored run, ready for another program: addressing, rows in use, learning rule, learnt weights."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cmacexp.cmac.addressing import RECTANGULAR, Address
from cmacexp.cmac.rules import NEIGHBOURS
from cmacexp.config.machine import RobotMachine
from cmacexp.config.schema import NONE, Config
from cmacexp.data.run import Run, read_config
from cmacexp.data.weights import WEIGHTS, load_weights
from cmacexp.errors import BadInput, BadRun
from cmacexp.feedforward import CmacFeedforward, CmacOnModel, RadialBasis
from cmacexp.feedforward.kernels import FeedforwardParams
from cmacexp.feedforward.network import planned_inputs
from cmacexp.planning import Setup, make_plan
from cmacexp.planning.machine import make_mechanism
from cmacexp.recording.run_view import read_robot_of_run
from cmacexp.typing import Array, Weights

EXPORTED = {"cmac": CmacFeedforward, "cmac_on_model": CmacOnModel, "rbf": RadialBasis}
"""Feedforwards that can be exported, by their options."""
MOST_LEAD = 1000
MOST_TORQUES = 2**15
"""Torques of a model that are a small table."""
NetworkFeedforward = CmacFeedforward | CmacOnModel | RadialBasis
Rows = Sequence[Any]
"""(rows,) of each leg: those of the run that are kept, in their new order."""


@dataclass(frozen=True)
class Network:
    """Networks of L legs with J joints over a cycle of N samples."""

    kind: str
    """Of EXPORTED."""
    params: FeedforwardParams
    """Rows are numbered as exported, along the plan and in the weights (L, rows, J)."""
    inputs: Array
    """(N, L, n): planned."""
    input_names: Sequence[str]
    addresses: Sequence[Address]
    """Of each leg; empty: cells are known for one path alone."""
    field: int
    """Receptive field; of other activations than those of a CMAC -1."""
    places: Sequence[Any]
    """(rows,) of each leg with visited addressing: position of the cell of every row, in order; else empty."""
    model_torque: Array | None
    """(N, L, J): torque of a model that is added, N m."""
    is_learnt: bool
    """Whether the run stored its weights."""
    machine: str

    @property
    def is_weighted(self) -> bool:
        """Whether activations are not all 1."""
        return self.field != RECTANGULAR


def read_network(run: Run, one_path: bool) -> Network:
    """The network of a run whose classes are all those of the package; raises BadInput or BadRun.

    ``one_path`` keeps the cells of the planned path alone, by sample, instead of the addressing.
    """
    kind = require_exportable(run)
    config = read_final_config(run)
    learnt = read_learnt(run)
    feedforward, setup = _reset(run, kind, config, learnt)
    one_path = one_path or isinstance(feedforward, RadialBasis)
    if setup.lead < -1 and not one_path:
        reason = "trains cells of steps to come, which are known for one path alone; add --path"
        raise BadInput("learning.lead", setup.lead, reason)
    torque = feedforward.model_torque
    if torque is not None and not one_path and torque.size > MOST_TORQUES:
        reason = f"has {torque.size} torques a cycle, more than {MOST_TORQUES}; add --path, or export cmac"
        raise BadInput("feedforward", kind, reason)
    return _make_network(run, kind, feedforward, setup, one_path, learnt is not None)


def require_exportable(run: Run) -> str:
    """The kind of its network, before anything that a run names is imported; raises BadInput."""
    plain = run.config
    for group in ("plant", "sensors", "controller"):
        if not (target := plain[group]["_target_"]).startswith("cmacexp."):
            raise BadInput(f"{group}._target_", target, "must be of cmacexp: a custom component is not imported here")
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
    lead, rate = (run.manifest.get(f"learning_{name}") for name in ("lead", "rate"))
    if lead is None or rate is None or not -MOST_LEAD <= lead <= MOST_LEAD or not 0 < rate < 2:
        raise BadRun(f"{run.folder}: learning_lead={lead} and learning_rate={rate} are none of a run; run it again")
    return replace(config, learning=replace(config.learning, lead=int(lead), rate=float(rate), start_from=None))


def read_learnt(run: Run) -> Weights | None:
    """What the run stored of its network; None if it kept nothing. Raises BadRun."""
    if WEIGHTS not in run.manifest["files"]:
        if run.config["learning"].get("start_from") is not None:
            raise BadRun(f"{run.folder}: started from weights, but stored none; run it with record.weights=true")
        return None
    return load_weights(run.folder)


def _reset(run: Run, kind: str, config: Config, learnt: Weights | None) -> tuple[NetworkFeedforward, Setup]:
    """The feedforward along the plan of the run, and what it was made of."""
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
    if feedforward.params.learning.rule.teaches == NEIGHBOURS:
        reason = "cannot be exported: it trains the cells of many steps at once; any other rule can"
        raise BadInput("learning.rule", config.learning.rule, reason)
    return feedforward, setup


def _require_fitting(feedforward: NetworkFeedforward) -> None:
    """Require finite weights and a row for every cell, since the file may hold anything; raises ValueError."""
    params, rows = feedforward.params, feedforward.params.weights.shape[1]
    ranges = feedforward.learnt()["ranges"]
    if not all(np.isfinite(each).all() for each in (params.weights, params.activation, ranges)):
        raise ValueError("not all of it is finite")
    for cmac in getattr(feedforward, "cmacs", ()):
        if cmac.visited is not None:
            positions = cmac.visited.positions
            if positions.dtype != np.uint64 or positions.ndim != 1 or len(positions) > rows:
                raise ValueError("visited cells")
    if params.cells.max() >= rows:
        raise ValueError("cells without a row")


def _make_network(
    run: Run, kind: str, feedforward: NetworkFeedforward, setup: Setup, one_path: bool, is_learnt: bool
) -> Network:
    params, config = feedforward.params, setup.config
    legs, rows = params.weights.shape[:2]
    places: Rows = []
    kept: Rows = [np.arange(rows)] * legs
    names: list[str] = [] if isinstance(feedforward, RadialBasis) else config.cmac.inputs
    cmacs = [] if isinstance(feedforward, RadialBasis) else feedforward.cmacs
    if one_path:
        kept = list_path_rows(params)
    elif cmacs[0].visited is not None:
        found = [np.unique(cmac.visited.positions, return_index=True) for cmac in cmacs if cmac.visited is not None]
        places, kept = zip(*found, strict=True)
    inputs = [np.zeros((len(params.cells), 0)) if one_path else planned_inputs(setup, i, names) for i in range(legs)]
    return Network(
        kind,
        keep_rows(params, kept),
        np.stack(inputs, axis=1),
        [] if one_path else names,
        [] if one_path else [cmac.address for cmac in cmacs],
        cmacs[0].receptive_field if cmacs else -1,
        places,
        feedforward.model_torque,
        is_learnt,
        config.machine.kind,
    )


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
