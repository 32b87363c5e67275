"""Adaptation of the plan, from cycle to cycle, to the load on the feet and the slope of the ground."""

import copy
import math

import numpy as np

from cmacexp.control.load_meter import LoadMeter, read_meter
from cmacexp.data.records import CarriedLoad
from cmacexp.errors import BadInput, require
from cmacexp.loop.state import copy_arrays
from cmacexp.planning.plan import NOTHING, LoadEstimate, Setup, adapt_plan
from cmacexp.typing import Array

LEAST = LoadEstimate(weight=0.002, x=0.0002, y=0.0002, slope_x=0.0005, slope_y=0.0005)
"""Smallest changes that cause a new plan; weight relative to the planned weight."""
SMOOTHING = 2.0
"""Time constant of the filter over cycles, s."""
LEAST_BORNE, MOST_BORNE = 0.5, 3.0
"""Accepted ratios of measured to planned load in the first cycle; outside, the model does not fit the robot."""
MOST = LoadEstimate(weight=math.inf, x=0.002, y=0.002, slope_x=0.02, slope_y=0.02)
"""Largest changes of the plan from one cycle to the next."""


class Adaptation:
    """Estimator of load and slope, which replaces the plan of a run in place if they have changed."""

    def __init__(self, setup: Setup, meter: LoadMeter):
        self.setup = setup
        self.meter = meter
        self.nominal = copy.deepcopy(setup.plan)
        self.planned_load = self.new_load = NOTHING
        """Load of the present plan, and of the next one, as differences from the nominal plan."""
        cycle = setup.config.gait.cycle_time
        self.gain = cycle / (cycle + SMOOTHING)
        self.is_first = True
        """True in the first cycle, which starts from rest: this shifts the centre of the load."""
        self.measured = 0.0
        """Total load on the feet in the last cycle, N."""
        self.carried: list[CarriedLoad] = []
        """Record of all adapted plans, with total weights."""

    def reset(self) -> None:
        """Restore the nominal plan and discard all estimates."""
        if self.planned_load != NOTHING:
            copy_arrays(self.nominal, self.setup.plan)
        self.planned_load = self.new_load = NOTHING
        self.is_first = True
        self.carried.clear()

    def end_cycle(self) -> bool:
        """Read the load meter after a cycle; return True if the plan has to change, by :meth:`update_plan`.

        Raises BadInput if the load in the first cycle is implausible for the model.
        """
        load = read_meter(self.meter, self.nominal)
        planned_weight = self.nominal.load.force.mean()
        self.measured = float(planned_weight) + load.weight
        if self.is_first:
            share = load.weight / planned_weight + 1.0
            carried = f"in the first cycle its feet carried {share:.2g} of its weight"
            limits = f"not {LEAST_BORNE:g} to {MOST_BORNE:g}: use m, kg and rad in the model, or a lighter payload"
            require(
                LEAST_BORNE <= share <= MOST_BORNE,
                "machine.kind",
                self.setup.config.machine.kind,
                f"{carried}, {limits}",
            )
            self.new_load = NOTHING._replace(weight=load.weight)
            self.is_first = False
        else:
            change = np.subtract(load, self.planned_load)
            if (np.abs(change) > LEAST._replace(weight=LEAST.weight * planned_weight)).any():
                limited_change = np.clip(self.gain * change, np.negative(MOST), MOST)
                new_load: Array = np.add(self.planned_load, limited_change)
                self.new_load = LoadEstimate(*new_load.tolist())
        return self.new_load != self.planned_load

    def update_plan(self, cycle: int) -> None:
        """Adapt the plan, from ``cycle`` on, to the last estimate; keep the present plan if the legs cannot reach."""
        if self.new_load == self.planned_load:
            return
        try:
            plan = adapt_plan(self.setup.config, self.setup.mechanism, self.nominal, self.new_load)
        except BadInput:
            self.new_load = self.planned_load
            return
        copy_arrays(plan, self.setup.plan)  # in place, since the loop and its components share these arrays
        self.planned_load = self.new_load
        total_load = self.new_load._replace(weight=float(self.nominal.load.force.mean()) + self.new_load.weight)
        self.carried.append(CarriedLoad(cycle=cycle, measured_weight=self.measured, **total_load._asdict()))
