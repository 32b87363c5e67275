"""A scenario that runs again and again at other rates of learning, or with other seeds, some runs of one leg at once.

Legs on a stand know nothing of each other: runs of one leg are made as the legs of one machine, and each moves as it
does alone, to the bit. All that is done once a run, and once a step, is then done once for all of them.
"""

from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmacexp.cmac.network import MemoryUse
from cmacexp.config import Config
from cmacexp.config.schema import ADAPTIVE, ESTIMATE, NONE
from cmacexp.feedforward.kernels import TABLE, FeedforwardParams, WeightLog
from cmacexp.feedforward.network import BuiltInFeedforward
from cmacexp.jit.compiler import workload
from cmacexp.loop.builtin import find_external, make_loop
from cmacexp.loop.run import End
from cmacexp.loop.scenario import Scenario, resolve_rate
from cmacexp.loop.state import Snapshot, list_arrays
from cmacexp.models.loop_delay import LoopDelay
from cmacexp.models.mechanism import has_body
from cmacexp.planning.plan import Setup
from cmacexp.plants import AnalyticPlant
from cmacexp.sensors.protocol import find_altered
from cmacexp.typing import Cells

MOST_CELLS = 1 << 23
"""Active cells of all samples of runs at once: more of them, 12 bytes each, are slower at once than one by one."""


class Repeated:
    """A scenario, or some of one leg at once, that runs again and again: the arrays of its loop return.

    Nothing but what a feedforward computes from the seed is made anew.
    """

    def __init__(self, scenario: Scenario, count: int = 1):
        """Prepare so many runs at once like that of a new scenario, which cannot run afterwards."""
        assert isinstance(scenario.feedforward, BuiltInFeedforward)
        self._alone, self._feedforward = scenario.setup, scenario.feedforward
        self._seed: int | None = None
        """Seed with which the feedforward has computed what it has for all runs so far."""
        if count > 1:
            setup = _repeat_setup(self._alone, count)
            nominal = replace(setup, config=setup.config.nominal)
            scenario = replace(scenario, setup=setup, first=scenario.plant.reset(setup))
            scenario.sensors.reset(nominal)
            scenario.controller.reset(nominal, self._feedforward)
        self._scenario = scenario
        self._loop = make_loop(scenario, find_external(scenario))._replace(feedforward=None)
        self._start = Snapshot(each.array for each in list_arrays(self._loop) if each.role is not None)

    @staticmethod
    def serves(scenario: Scenario, count: int = 1) -> bool:
        """Whether arrays of the loop hold all that a run changes, and nothing but a feedforward follows the rate.

        Of several runs at once, moreover, nothing may tell their legs apart.
        """
        setup, plant, feedforward = scenario.setup, scenario.plant, scenario.feedforward
        if not isinstance(feedforward, BuiltInFeedforward) or not isinstance(plant, AnalyticPlant):
            return False
        config, components = setup.config, (plant, scenario.sensors, scenario.controller, feedforward)
        learning, own = config.learning, all(type(each).__module__.startswith("cmacexp.") for each in components)
        fixed = learning.guard == NONE and learning.lead != ESTIMATE and config.force_control.load_sharing != ADAPTIVE
        learns = own and scenario.fault is None and feedforward.params.kind != TABLE
        serves = fixed and learns and not any(find_external(scenario))
        is_leg = setup.mechanism.shape[0] == 1 and not has_body(setup.mechanism)
        apart = plant.config.start_spread, config.terrain.step_legs, find_altered(scenario.sensors)
        if count == 1 or not serves:
            return serves
        fits = feedforward.params.cells.size * count <= MOST_CELLS
        return fits and is_leg and not any(apart) and not config.plausibility.enabled

    def start(self, configs: Sequence[Config]) -> Scenario:
        """A scenario for configs that differ in seed and rate of learning alone; the one before has ended."""
        self._start.restore()
        feedforward, learners, memory = self._feedforward, list[FeedforwardParams](), list[MemoryUse]()
        for config in configs:
            if config.seed != self._seed:
                with workload(config.cycles * config.steps_per_cycle * config.legs):
                    feedforward.reset(replace(self._alone, config=config.nominal))
                self._seed, self._model = config.seed, feedforward.model_torque
                self._learner, self._memory = _compact(feedforward.params), feedforward.memory
            learners.append(self._learner)
            memory += self._memory
        rates = [resolve_rate(config, LoopDelay(), self._alone.lead) for config in configs]
        feedforward.params, feedforward.memory = _join_learners(learners, rates), memory
        if self._model is not None:
            feedforward.model_torque = self._model.repeat(len(configs), axis=1)
        setup = replace(self._scenario.setup, config=configs[0], rate=rates[0])
        return replace(self._scenario, setup=setup, loop=self._loop._replace(feedforward=feedforward.params))


def split_runs(scenario: Scenario, configs: Sequence[Config], end: End) -> Iterator[tuple[Scenario, End]]:
    """The scenario and the end of runs at once, which completed, as those of each: all that a manifest says of it."""
    feedforward, loop, count = scenario.feedforward, scenario.loop, len(configs)
    assert isinstance(feedforward, BuiltInFeedforward)
    assert loop is not None
    assert loop.feedforward is not None
    end = replace(end, seconds=end.seconds / count, processor_seconds=end.processor_seconds / count)
    for config, rate, memory in zip(configs, loop.feedforward.learning.rate, feedforward.memory, strict=True):
        own = copy(feedforward)
        own.memory = (memory,)
        setup = replace(scenario.setup, config=config, rate=float(rate))
        yield replace(scenario, setup=setup, feedforward=own), replace(end, rate=float(rate))


def _repeat(values: tuple[NDArray[Any], ...], count: int, axis: int = 1) -> Any:
    """A named tuple of arrays of one leg as one of so many legs."""
    return type(values)(*(each.repeat(count, axis) for each in values))


def _repeat_setup(setup: Setup, count: int) -> Setup:
    """The setup of one leg as that of so many."""
    plan, mechanism = setup.plan, setup.mechanism
    plan = plan._replace(
        support=plan.support.repeat(count, 1),
        progress=plan.progress.repeat(count, 1),
        desired=_repeat(plan.desired, count),
        joints=_repeat(plan.joints, count),
        force_desired=plan.force_desired.repeat(count, 1),
        reference=_repeat(plan.reference, count, axis=2),
    )
    mechanism = mechanism._replace(legs=mechanism.legs.repeat(count, 0), hips=mechanism.hips.repeat(count, 0))
    return replace(setup, plan=plan, mechanism=mechanism, start=setup.start.repeat(count, 0))


def _compact(params: FeedforwardParams) -> FeedforwardParams:
    """Networks with memory for the rows alone that they use, in their order: many of them fit into the cache."""
    places, log = list[Cells](), params.log
    for rows, used in zip(log.rows, log.used, strict=True):
        places.append(np.zeros(params.weights.shape[1], np.uint32))
        places[-1][rows[:used]] = np.arange(used)

    def renumber(cells: Cells) -> Cells:
        legs = zip(places, cells.swapaxes(0, 1), strict=False)  # of cells that nothing uses there is one leg
        return np.ascontiguousarray(np.stack([place[own] for place, own in legs], axis=1))

    weights = np.stack([own[rows] for own, rows in zip(params.weights, log.rows, strict=True)])
    own_learning = params.learning._replace(cells=renumber(params.learning.cells))
    return params._replace(cells=renumber(params.cells), weights=weights, learning=own_learning)


def _join_learners(learners: Sequence[FeedforwardParams], rates: Sequence[float]) -> FeedforwardParams:
    """Compact networks as those of one machine at the start of a run; ``rates`` are those of their learning."""
    first, learning = learners[0], [each.learning for each in learners]

    def join(name: str, parts: Sequence[Any] = learners) -> NDArray[Any]:
        """An array (N, L, ...) of each of the parts as one with the legs of all."""
        return np.concatenate([getattr(part, name) for part in parts], axis=1)

    used, (legs, _, joints) = np.concatenate([each.log.used for each in learners]), first.weights.shape
    weights = np.zeros((len(used), used.max(), joints))
    for own, each in zip(weights.reshape(len(learners), legs, -1, joints), learners, strict=True):
        own[:, : each.weights.shape[1]] = each.weights
    rows = np.broadcast_to(np.arange(used.max(), dtype=np.uint32), weights.shape[:2]).copy()
    values = np.zeros((len(first.log.values), len(used), first.log.values.shape[2]))
    shares, of_shares = join("share", learning), join("cells", learning)
    return first._replace(
        torque=join("torque"),
        cells=join("cells"),
        activation=join("activation"),
        weights=weights,
        learning=learning[0]._replace(rate=np.repeat(rates, legs), cells=of_shares, share=shares),
        log=WeightLog(rows, used, values, np.zeros(1, np.int64)),
    )
