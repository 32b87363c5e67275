"""The plan of a run follows the load that its feet carried and the slope that they met, from cycle to cycle."""

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
"""Changes from which on the plan is made anew; the weight over the planned one."""
SMOOTHING = 2.0
"""Time over which cycles are averaged, s."""
LEAST_BORNE, MOST_BORNE = 0.5, 3.0
"""Load of the feet in the first cycle over the planned one; beyond, the model is of another robot."""
MOST = LoadEstimate(weight=math.inf, x=0.002, y=0.002, slope_x=0.02, slope_y=0.02)
"""Changes from one cycle to the next that the plan follows."""


class Adaptation:
    """Makes the plan of a run anew, in place, wherever its feet have met something else."""

    def __init__(self, setup: Setup, meter: LoadMeter):
        self.setup, self.meter = setup, meter
        self.nominal = copy.deepcopy(setup.plan)
        self.known = self.new = NOTHING
        cycle = setup.config.gait.cycle_time
        self.gain, self.begun = cycle / (cycle + SMOOTHING), False
        """``begun``: a cycle has ended. The first one starts from rest, which moves the centre of the load."""
        self.measured = 0.0
        """All that the feet carried in the cycle that has ended, N."""
        self.carried: list[CarriedLoad] = []
        """What the plan used, its weight that of the whole load."""

    def reset(self) -> None:
        """Return to the start of the run, of which nothing is known."""
        if self.known != NOTHING:
            copy_arrays(self.nominal, self.setup.plan)
        self.known = self.new = NOTHING
        self.begun = False
        self.carried.clear()

    def end_cycle(self) -> bool:
        """Whether what was met in the cycle that has ended asks for another plan; :meth:`update_plan` makes it.

        Raises BadInput if in the first cycle the feet carried what no robot of that model weighs.
        """
        met, planned = read_meter(self.meter, self.nominal), self.nominal.load.force.mean()
        self.measured = float(planned) + met.weight
        if not self.begun:
            share, limits = met.weight / planned + 1.0, f"{LEAST_BORNE:g} to {MOST_BORNE:g}"
            carried = f"in the first cycle its feet carried {share:.2g} of its weight, not {limits}"
            reason = f"{carried}: use m, kg and rad in the model, or a lighter payload"
            fits = LEAST_BORNE <= share <= MOST_BORNE
            require(fits, "machine.kind", self.setup.config.machine.kind, reason)
            self.new, self.begun = NOTHING._replace(weight=met.weight), True
        else:
            change, least = np.subtract(met, self.known), LEAST._replace(weight=LEAST.weight * planned)
            if (np.abs(change) > least).any():
                known: Array = np.add(self.known, np.clip(self.gain * change, np.negative(MOST), MOST))
                self.new = LoadEstimate(*known.tolist())
        return self.new != self.known

    def update_plan(self, cycle: int) -> None:
        """Let the plan follow what was met before ``cycle``, unless the legs cannot reach there."""
        if self.new == self.known:
            return
        try:
            plan = adapt_plan(self.setup.config, self.setup.mechanism, self.nominal, self.new)
        except BadInput:
            self.new = self.known
            return
        copy_arrays(plan, self.setup.plan)  # which the loop and its components hold
        self.known = self.new
        whole = self.new._replace(weight=float(self.nominal.load.force.mean()) + self.new.weight)
        self.carried.append(CarriedLoad(cycle=cycle, measured_weight=self.measured, **whole._asdict()))
