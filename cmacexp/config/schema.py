"""The configuration of a run: one dataclass per group, unit and range beside every field.

Values stand in ``conf/``, never here. *Assumed* marks what Lin & Song 1997 do not give.
"""

from dataclasses import dataclass, field
from typing import Any

from cmacexp.config.cmac import CmacConfig
from cmacexp.config.environment import PayloadConfig, TerrainConfig
from cmacexp.config.feedforwards import (
    InverseDynamicsConfig,
    IterativeLearningConfig,
    PerceptronConfig,
    RadialBasisConfig,
)
from cmacexp.config.fields import choice, number
from cmacexp.config.machine import QuadrupedMachine
from cmacexp.config.mujoco import MujocoLegConfig, MujocoQuadrupedConfig
from cmacexp.config.sensors import RealSensorsConfig


@dataclass
class GaitConfig:
    """When and along which path the feet move."""

    pattern: str = choice("transfer_first", "standing", "wave")
    """transfer_first: one leg, a cycle begins with lift-off; standing: one leg, no transfer; wave: four legs."""
    touch_down: list[float] | None = number("cycles", at_least=0, below=1)
    """Touch-down of each leg within the cycle; null: by the pattern."""
    cycle_time: float = number("s", at_least=1e-3, at_most=1e5)
    """T."""
    duty_factor: float = number("", above=0, at_most=1)
    """Fraction of the cycle in which a foot supports."""
    stroke: float = number("m", at_least=0)
    """Travel of the foot on the ground during support (assumed)."""
    lift: float = number("m", at_least=0)
    """Apex of the transfer above the take-off point (assumed)."""
    vertical: str = choice("cubic", "two_cubics")
    """cubic: one through both ends and the apex, its speed jumps (assumed); two_cubics: at rest at ends and apex."""
    load_ramp: float = number("s", at_least=0)
    """Time after touch-down over which a foot takes its desired force; 0: a step, as in the paper."""
    allow_unstable: bool = field(kw_only=True)
    """Run a gait of four legs that is not statically stable."""


@dataclass
class ControllerConfig:
    """Position control and the LEAD compensator (Lin & Song 1997, eq. 5-7, 21)."""

    _target_: str
    position_gain: float = number("N/m", above=0, at_most=1e9)
    """K_ap."""
    velocity_gain: float = number("N s/m", at_least=0, at_most=1e9)
    """K_av."""
    lead_omega: float = number("rad/s", above=0, at_most=1e6)
    """Lower corner frequency omega (assumed; see pipelines/lead_design.py)."""
    lead_alpha: float = number("", above=0, at_most=1e6)
    """Upper over lower corner frequency, alpha (assumed)."""


@dataclass
class ActuatorConfig:
    """What becomes of the commanded torque."""

    torque_limit: float | None = number("N m (N for a point mass)", above=0)
    """Largest absolute torque of each joint; null: none."""
    rate_limit: float | None = number("N m/s (N/s for a point mass)", above=0)
    """Fastest change of the torque of each joint; null: none."""
    delay: int = number("samples", at_least=0)
    """A torque that is commanded at step k acts from step k + delay."""

    @property
    def limit(self) -> float:
        """The largest absolute torque, infinite if there is none."""
        return float("inf") if self.torque_limit is None else self.torque_limit


@dataclass
class PostureConfig:
    """Posture control of a body (Lin & Song 1997, section 6.2)."""

    gain: float = number("", at_least=0)
    """Depth that a supporting foot is pushed down, over the height that its hip lacks; 0 switches it off."""
    rate_gain: float = number("", at_least=0)
    """Speed at which a supporting foot is pushed down, over the speed at which its hip sinks; 0 as in the paper."""


@dataclass
class ForceControlConfig:
    """Force control in the support phase (Lin & Song 1997, eq. 8-15)."""

    method: str = choice("stiffness", "damping", "combined", "explicit")
    desired_force: float | None = number("N", above=0)
    """F_d; null under a body, whose weight is shared out among the feet."""
    elasticity: float = number("m/N", at_least=0, at_most=1e6)
    """P_fn."""
    admittance: float = number("m/(N s)", at_least=0, at_most=1e6)
    """V_fn."""
    force_gain: float = number("", above=0, at_most=1e9)
    """K_a of explicit force control; stiffness uses K_ap and damping K_av for K_a."""
    load_sharing: str = choice("static", "dynamic")
    """What feet share under a body; static: its weight, as in the paper; dynamic: gravity, inertia of all masses."""


@dataclass
class PlausibilityConfig:
    """Whether the controller looks if a force sensor can be believed, and drops one that cannot."""

    enabled: bool
    tolerance: float = number("N", above=0, at_most=1e9)
    """Difference from the force expected at the measured depth that raises no doubt."""
    relative_tolerance: float = number("", at_least=0, below=1)
    """Likewise over the expected force; at 1 a sensor stuck at zero would pass."""
    patience: int = number("samples", at_least=1, at_most=10**6)
    """So many that are wrong by twice the tolerance drop a sensor."""


@dataclass
class LearningConfig:
    """The learning rule (Lin & Song 1997, eq. 19, 20) and the strengths of the others."""

    rule: str
    """One of cmacexp/cmac/rules.py; each but the paper's has its strength in a field below."""
    rate: float = number("", above=0, below=2)
    """beta; 50/256 in the paper."""
    lead: int | float | str = number("samples", at_least=-100, at_most=100, words=("auto",))
    """U(k-1) trains the cells of step k-1-lead; 0 as in the paper; auto: the samples from torque to feedback."""
    start_cycle: int = number("", at_least=1, at_most=10**9)
    """First cycle in which the feedforward learns and acts."""
    start_from: str | None = field(kw_only=True)
    """Folder of a run that kept its weights (record.weights), with which the feedforward begins; null: none."""
    regularisation: float = number("", at_least=0, at_most=1e6)
    """normalised: added to sum a_i^2, over its mean along the plan; 0: the paper's rule."""
    dead_zone: float = number("N m", at_least=0)
    """dead_zone: feedback up to this teaches nothing; 0: the paper's rule."""
    leakage: float = number("", at_least=0, at_most=1)
    """leakage, zero_phase: an active weight loses beta times this of itself; 0: none."""
    e_modification: float = number("1/(N m)", at_least=0, at_most=1e6)
    """e_modification: loses beta |U| times this; the output stays within its inverse; 0: the paper's rule."""
    smoothing: float = number("", at_least=0, at_most=1)
    """weight_smoothing: goes beta times this of its way to the mean of the active ones, kappa of Macnab 2017."""
    window: int = number("samples", at_least=0, at_most=10**4)
    """zero_phase: an error teaches so many samples to both sides, by binomial weights; 0: leakage alone."""
    decay: float = number("cycles", above=0, at_most=1e9)
    """decaying_rate: after so many cycles of learning the rate is half of beta, after twice as many a third."""


@dataclass
class RecordConfig:
    """What a run leaves behind besides trace and metrics."""

    recording: bool
    """Write recording.rrd, the Rerun view."""
    weights: bool
    """Write weights.npz, what the feedforward has learnt at the end."""
    every_nth_step: int = number("steps", at_least=1, at_most=10**9)
    """Keep one step in so many in the traces; the metrics are those of all steps."""
    cycles: list[int] | None = number("cycle", at_least=1, at_most=10**9)
    """Keep these cycles in the traces; null: all. The metrics are those of all cycles."""

    @property
    def thins(self) -> bool:
        """Whether the traces lack some of the steps."""
        return self.every_nth_step > 1 or self.cycles is not None


@dataclass
class SweepConfig:
    """How a sweep goes about its jobs."""

    resume: bool
    """Do not run jobs again whose result the sweep's folder holds."""


@dataclass
class Config:
    """One run, whole."""

    scenario: str
    machine: Any
    plant: Any
    terrain: TerrainConfig
    payload: PayloadConfig
    gait: GaitConfig
    sensors: Any
    controller: Any
    actuator: ActuatorConfig
    posture: PostureConfig
    force_control: ForceControlConfig
    plausibility: PlausibilityConfig
    feedforward: Any
    cmac: CmacConfig
    learning: LearningConfig
    record: RecordConfig
    sweep: SweepConfig
    optimize: str | None
    """Metric whose final value a job of a sweep gives to the sweeper (see cmacexp/sweep/objective.py); null: none."""
    warn: bool
    """Say before a long run if its learning is predicted to come apart (see cmacexp/stability/warn.py)."""
    cycles: int = number("", at_least=1, at_most=10**9)
    seed: int = number("", at_least=0, below=2**32)
    """Seeds the hash of the CMAC's memory, and every part that draws random numbers."""
    sampling_period: float = number("s", at_least=1e-6, at_most=1e3)
    """T_s."""
    reference: str = choice("literal", "aware", "force_feedforward")
    """literal: eq. 9, 11, 13, 15 always; aware: without their 1/K_a term while a feedforward acts;
    force_feedforward: the desired force is added to the feedback instead."""

    @property
    def steps_per_cycle(self) -> int:
        """Samples of one cycle, N = T / T_s."""
        return round(self.gait.cycle_time / self.sampling_period)

    @property
    def body_speed(self) -> float:
        """Speed of a body over the ground, stroke / (duty factor x T), m/s; 0 without a body."""
        walks = isinstance(self.machine, QuadrupedMachine)
        return self.gait.stroke / (self.gait.duty_factor * self.gait.cycle_time) if walks else 0.0

    @property
    def lead(self) -> int:
        """``learning.lead`` in samples; auto is the number of them from a torque to the feedback that it causes.

        Late positions do not count where there is velocity feedback, which outweighs them at the frequencies that a
        wrong lead makes grow.
        """
        if self.learning.lead != "auto":
            return int(self.learning.lead)
        late = 0
        if isinstance(self.sensors, RealSensorsConfig):
            late = (self.sensors.velocity if self.gains is None or self.gains[1] else self.sensors.position).delay
        return 1 + self.actuator.delay + late

    @property
    def gains(self) -> tuple[float, float] | None:
        """K_ap (N/m) and K_av (N s/m) of the controller; None of one that has no such fields, or no such numbers."""
        fields = self.controller if isinstance(self.controller, dict) else vars(self.controller)
        position, velocity = fields.get("position_gain"), fields.get("velocity_gain")
        if not (isinstance(position, int | float) and isinstance(velocity, int | float)):
            return None
        return (position, velocity) if position > 0 and velocity >= 0 else None

    @property
    def assumed_stiffness(self) -> float:
        """K_n as planner and controller believe it, N/m."""
        return self.terrain.assumed_stiffness or self.terrain.stiffness


@dataclass
class AnalyticPlantConfig:
    """The project's own equations of motion."""

    _target_: str
    substeps: int = number("", at_least=1, at_most=10000)
    """Runge-Kutta steps per sampling period; 1 as in the paper."""


@dataclass
class PartWithoutFields:
    """A part that has nothing to set."""

    _target_: str


BUILT_IN_PARTS = {
    "cmacexp.plants.AnalyticPlant": AnalyticPlantConfig,
    "cmacexp.control.HybridController": ControllerConfig,
    "cmacexp.plants.mujoco_leg.MujocoLeg": MujocoLegConfig,
    "cmacexp.plants.mujoco_quadruped.MujocoQuadruped": MujocoQuadrupedConfig,
    "cmacexp.sensors.PerfectSensors": PartWithoutFields,
    "cmacexp.sensors.RealSensors": RealSensorsConfig,
    "cmacexp.control.NoFeedforward": PartWithoutFields,
    "cmacexp.control.CmacFeedforward": PartWithoutFields,
    "cmacexp.control.InverseDynamics": InverseDynamicsConfig,
    "cmacexp.control.RadialBasis": RadialBasisConfig,
    "cmacexp.control.Perceptron": PerceptronConfig,
    "cmacexp.control.IterativeLearning": IterativeLearningConfig,
}
"""Schemas of the parts that a ``_target_`` can name; another target brings its own fields, unchecked here."""
