"""The configuration of a run: one dataclass per group, with unit and range of every field.

Values are in ``conf/``, never here. *Assumed* marks values that Lin & Song 1997 do not give.
"""

from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

from cmacexp.config.cmac import CMACS, NEEDS_LEARNING, CmacConfig
from cmacexp.config.fields import choice, number
from cmacexp.config.gait import PATTERNS, GaitConfig
from cmacexp.config.machine import HAS_BODY, BodyMachine, RobotMachine
from cmacexp.models.robot_legs import JOINTS

NONE, FREEZE, REFINE = GUARDS = ("none", "freeze", "refine")
AUTO, ESTIMATE = "auto", "estimate"
ADAPTIVE = "adaptive"
NEEDS_DRAWS = (
    f"learning.start_cycle <= cycles and option.feedforward in {CMACS} and cmac.addressing == 'hashed' and "
    "learning.start_from is None or learning.lead == 'estimate' or sensors.draws",
)
"""Condition for an effect of the seed: some component draws random numbers."""
RATES = ("gait.pattern != 'standing' or gait.load_ramp > 0 or gait.unload_ramp > 0 or terrain.damping > 0",)
"""Condition for an effect of depression rates: the desired force changes, or the ground has damping."""
NEEDS_MOTION = ("machine.kind != 'point_mass' or gait.stroke > 0 or option.sensors != 'perfect'",)
"""Condition for an effect of a slope: a point mass without horizontal motion touches the ground at one height."""


@dataclass
class TerrainConfig:
    """Elastic ground (Lin & Song 1997, eq. 1). The plan uses its stiffness, with ``load_rate`` also its damping."""

    stiffness: float = number("N/m", at_least=1e-3, at_most=1e9)
    """True stiffness of the ground, K_n, used by the plant."""
    assumed_stiffness: float | None = number("N/m", at_least=1e-3, at_most=1e9)
    """Stiffness that planner and controller use; null: the true initial one."""
    patch_size: float = number("m", at_least=1e-3, needs=("own.patch_spread > 0",))
    """Side length of the square patches of the ground."""
    patch_spread: float = number("", at_least=0, below=1)
    """Random variation of the stiffness: that of a patch is K_n times 1 - spread to 1 + spread; 0: uniform ground."""
    patch_seed: int = number("", at_least=0, below=2**32, needs=("own.patch_spread > 0",))
    """Seed of the patches."""
    damping: float = number("N s/m", at_least=0, at_most=1e9)
    """Damping of the ground, normal force over depression rate; 0 as in the paper. The force is never negative."""
    step_time: float | None = number("s", at_least=0, needs=("own.step_factor != 1",))
    """Time of a step of the stiffness; null: no step."""
    step_factor: float = number("", at_least=1e-3, at_most=1e3, needs=("own.step_time is not None",))
    """Stiffness after the step over that before it."""
    step_legs: list[int] | None = number(
        "", at_least=1, at_most=4, needs=("own.step_time is not None", "own.step_factor != 1", *HAS_BODY)
    )
    """Numbers of the legs under which the stiffness steps; null: all legs."""
    slope: float = number("", above=-1, below=1, needs=NEEDS_MOTION)
    """Slope of the ground, rise over distance, m/m; 0: flat. The vertical stiffness is that of flat ground."""
    slope_start: float = number("m", needs=("own.slope != 0", *NEEDS_MOTION))
    """World position x at which the slope begins; flat before it. The centre of the body starts at x = 0."""


@dataclass
class PayloadConfig:
    """A weight that is placed on the body during the run; planner and controller do not know it."""

    weight: float = number("N", at_least=0)
    """Weight of the payload; 0: none."""
    x: float = number("m", needs=("own.weight > 0",))
    """Position of the payload in the plane of the hips, forward of the centre of the body."""
    y: float = number("m", needs=("own.weight > 0",))
    """Position of the payload, to the left of the centre of the body."""
    time: float = number("s", at_least=0, needs=("own.weight > 0",))
    """Time at which the payload is placed on the body."""


@dataclass
class ActuatorConfig:
    """Actuators: limits, delay and lag from the commanded torque to the torque that acts."""

    torque_limit: float | None = number("N m (N for a point mass)", above=0)
    """Largest absolute torque of each joint; null: no limit."""
    rate_limit: float | None = number("N m/s (N/s for a point mass)", above=0)
    """Largest rate of change of the torque of each joint; null: no limit."""
    delay: int = number("samples", at_least=0)
    """Delay of the torque: a torque commanded at step k acts from step k + delay."""
    lag: float = number("s", at_least=0, at_most=1e3)
    """Time constant of the first-order lag of the torque, after limits and delay; 0: no lag."""

    @property
    def limit(self) -> float:
        """Largest absolute torque of a joint, N m; infinite without a limit."""
        return float("inf") if self.torque_limit is None else self.torque_limit


STEERED = ("machine.kind == 'robot'", "gait.stroke > 0")
"""Condition for an effect of steering."""
HYBRID = ("option.controller != 'drives'",)
"""Condition for an effect of posture control and fault detection; with loops in the drives neither exists."""


@dataclass
class PostureConfig:
    """Posture control of a body (Lin & Song 1997, section 6.2)."""

    needs: ClassVar[tuple[str, ...]] = HAS_BODY

    gain: float = number("", at_least=0, needs=HYBRID)
    """Posture gain: extra depth of a supporting foot over the height error of its hip, m/m; 0: off."""
    rate_gain: float = number("", at_least=0, needs=HYBRID)
    """Rate gain of the posture: extra depth rate of a supporting foot over the sinking rate of its hip; 0 as in the
    paper."""
    course_gain: float = number("1/s", at_least=0, at_most=100, needs=STEERED)
    """Course gain: correcting speed of a robot over its position error; 0: off."""
    heading_gain: float = number("1/s", at_least=0, at_most=100, needs=STEERED)
    """Heading gain: correcting yaw rate of a robot over its heading error; 0: off."""


@dataclass
class ForceControlConfig:
    """Force control in the support phase (Lin & Song 1997, eq. 8-15)."""

    method: str = choice("stiffness", "damping", "combined", "explicit")
    """Quantity that the force error corrects: depth (stiffness), velocity (damping), both (combined) or force
    (explicit)."""
    desired_force: float | None = number("N", above=0)
    """Desired contact force in support, F_d; null for a machine with a body, whose weight the feet share."""
    elasticity: float = number("m/N", at_least=0, at_most=1e6, needs=("own.method in ('stiffness', 'combined')",))
    """Correction of the reference depth per force error, P_fn."""
    admittance: float = number("m/(N s)", at_least=0, at_most=1e6, needs=("own.method in ('damping', 'combined')",))
    """Correction of the reference depth rate per force error, V_fn."""
    force_gain: float = number("", above=0, at_most=1e9, needs=("own.method == 'explicit'",))
    """Gain K_a of explicit force control; stiffness control uses K_ap and damping control K_av instead."""
    load_sharing: str = choice("static", "dynamic", ADAPTIVE, needs=HAS_BODY)
    """Load that the feet share; static: the weight of the body, as in the paper; dynamic: gravity and inertia of all
    masses; adaptive: also the extra load and the slope of the ground measured in past cycles."""
    switch: str = choice("plan", "contact", needs=("own.method in ('stiffness', 'combined')",), default="plan")
    """When the force terms of the error act (assumed); plan: in planned support; contact: whenever the foot presses,
    as eq. 21 is printed for both phases. The reference follows the plan."""
    load_rate: bool = field(kw_only=True, metadata={"needs": (*RATES, "own.method != 'explicit'")})
    """Include in the reference in support the rate of the depression for F_d, and its lag on damped ground."""

    @property
    def has_force_in_transfer(self) -> bool:
        """True if the force terms act whenever a foot presses; damping and explicit control have no other terms."""
        return self.switch == "contact" and self.method in ("stiffness", "combined")


@dataclass
class PlausibilityConfig:
    """Fault detection: the controller checks its force sensors and switches off implausible ones."""

    needs: ClassVar[tuple[str, ...]] = HYBRID

    enabled: bool
    """Check the force sensors."""
    tolerance: float = number("N", above=0, at_most=1e9, needs=("own.enabled",))
    """Largest plausible deviation from the force expected at the measured depth."""
    relative_tolerance: float = number("", at_least=0, below=1, needs=("own.enabled",))
    """Further plausible deviation, over the expected force; with 1 a sensor stuck at 0 would pass."""
    patience: int = number("samples", at_least=1, at_most=10**6, needs=("own.enabled",))
    """Number of readings, wrong by twice the tolerance, after which a sensor is switched off for the rest of the run
    (threshold of a CUSUM test on error over tolerance - 1)."""


@dataclass
class LearningConfig:
    """The learning rule of the paper (Lin & Song 1997, eq. 19, 20), and the parameters of other rules."""

    needs: ClassVar[tuple[str, ...]] = ("option.feedforward != 'none'",)

    rule: str = field(kw_only=True, metadata={"needs": NEEDS_LEARNING})
    """Learning rule, defined in cmacexp/cmac/rules.py; every rule except that of the paper has a parameter below."""
    rate: float | str = number("", above=0, below=2, words=(AUTO,), needs=NEEDS_LEARNING, tuned=(0.05, 1.5))
    """Learning rate beta, the fraction of the error that a step corrects. Paper: 50/256; auto:
    50/256/(2 x lead - 1)."""
    lead: int | float | str = number(
        "samples", at_least=-100, at_most=100, words=(AUTO, ESTIMATE), needs=NEEDS_LEARNING
    )
    """Samples from torque to feedback: U(k-1) trains the cells of step k-1-lead. The paper leaves it open: eq. 20 and
    21 as printed give -1, eq. 19 suggests 0 (assumed), training after the plant has moved gives 1. auto: from the
    declared delays of actuator and sensors; estimate: measured by a small probing torque before learning."""
    guard: str = choice(*GUARDS, needs=NEEDS_LEARNING)
    """Reaction if learning diverges or is worse than feedback only; none: no reaction; freeze: the torque of the best
    cycle is repeated; refine: it is also improved once per cycle, by the rule of the paper."""
    start_cycle: int = number("", at_least=1, at_most=10**9, needs=("own.start_from is None",))
    """First cycle in which the feedforward learns and acts, with a guard at least the second. With weights of another
    run the feedforward acts from the first cycle on. If larger than cycles, there is no feedforward."""
    start_from: str | None = field(kw_only=True, metadata={"needs": NEEDS_LEARNING})
    """Folder of a run with record.weights=true, whose weights are the initial ones; null: zero weights."""
    regularisation: float = number("", at_least=0, at_most=1e6)
    """normalised: constant added to sum a_i^2, as a fraction of its mean along the plan; 0: the rule of the paper."""
    dead_zone: float = number("N m", at_least=0)
    """dead_zone: absolute feedback torque below which weights do not change; 0: the rule of the paper."""
    leakage: float = number("", at_least=0, at_most=1)
    """leakage, zero_phase: fraction that an active weight loses per step, over beta; 0: no leakage."""
    e_modification: float = number("1/(N m)", at_least=0, at_most=1e6)
    """e_modification: leakage over |U|, which limits the output to the inverse of this; 0: the rule of the paper."""
    smoothing: float = number("", at_least=0, at_most=1)
    """weight_smoothing: fraction by which an active weight approaches the mean of the active weights per step, over
    beta; kappa of Macnab 2017."""
    window: int = number("samples", at_least=0, at_most=10**4)
    """zero_phase: number of samples before and after its own that an error trains, with binomial weights; 0: leakage
    only."""
    decay: float = number("cycles", above=0, at_most=1e9)
    """decaying_rate: the rate after n cycles of learning is beta/(1 + n/decay)."""


@dataclass
class RecordConfig:
    """Files that a run stores besides its metrics."""

    trace: bool
    """Write the traces, the metrics also as CSV, and the record of Hydra; false: metrics and manifest only."""
    recording: bool
    """Write recording.rrd, the Rerun view."""
    weights: bool
    """Write weights.npz, the learnt weights of the feedforward at the end."""
    every_nth_step: int = number("steps", at_least=1, at_most=10**9)
    """Store every n-th step in the traces, and the last 100 if a run does not complete; metrics use all steps."""
    cycles: list[int] | None = number("cycle", at_least=1, at_most=10**9)
    """Store only these cycles in the traces, and the same last steps; null: all cycles. Metrics use all cycles."""

    @property
    def thins(self) -> bool:
        """True if the traces do not contain all steps."""
        return self.every_nth_step > 1 or self.cycles is not None


@dataclass
class SweepConfig:
    """Execution of the jobs of a sweep."""

    resume: bool
    """Skip jobs whose results are already in the folder of the sweep."""
    chunk: int | None = number("jobs", at_least=1)
    """Number of jobs per task of a launcher such as ``submitit_slurm``; null: one."""


def read_component(component: Any) -> dict[str, Any]:
    """Return the fields of a component config as a dictionary; it is a config object, or already a dictionary."""
    return component if isinstance(component, dict) else vars(component)


def count_steps(cycle_time: float, sampling_period: float) -> int:
    """Compute the number of samples of one cycle, N = T / T_s."""
    return round(cycle_time / sampling_period)


@dataclass
class Config:
    """All fields of a run."""

    scenario: str
    """Option of conf/scenario on which the run is based."""
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
    optimize: str | None = field(kw_only=True, metadata={"needs": ("hydra.mode == 'MULTIRUN'",)})
    """Metric whose final value a job returns to a searching sweeper (see cmacexp/engine/objective.py); null: none."""
    warn: bool
    """Warn of overrides without effect (see cmacexp/engine/without_effect.py)."""
    cycles: int = number("", at_least=1, at_most=10**9)
    """Number of gait cycles of the run."""
    seed: int = number("", at_least=0, below=2**32, needs=NEEDS_DRAWS)
    """Seed of the hash of the CMAC memory and of all components that draw random numbers."""
    sampling_period: float = number("s", at_least=1e-6, at_most=1e3)
    """Sampling period of the control loop, T_s."""
    reference: str = choice("literal", "aware", "force_feedforward")
    """Reference of force control; literal: eq. 9, 11, 13, 15 throughout; aware: without their 1/K_a term while a
    feedforward acts; force_feedforward: without that term, and the desired force is added to the feedback."""

    @property
    def steps_per_cycle(self) -> int:
        """Number of samples of one cycle, N = T / T_s."""
        return count_steps(self.gait.cycle_time, self.sampling_period)

    @property
    def first_learning(self) -> int:
        """First cycle in which the feedforward acts: 1 with weights of another run, else ``learning.start_cycle``."""
        return self.learning.start_cycle if self.learning.start_from is None else 1

    @property
    def legs(self) -> int:
        """Number of legs."""
        return PATTERNS[self.gait.pattern].legs

    @property
    def joints(self) -> int:
        """Number of joints per leg; for a point mass its two axes."""
        return JOINTS if isinstance(self.machine, RobotMachine) else 2

    @property
    def has_body(self) -> bool:
        """True if the machine has a body on legs."""
        return isinstance(self.machine, BodyMachine)

    @property
    def body_speed(self) -> float:
        """Walking speed of the body, stroke / (duty factor x T), m/s; 0 without a body."""
        return self.gait.stroke / (self.gait.duty_factor * self.gait.cycle_time) if self.has_body else 0.0

    @property
    def gains(self) -> tuple[float, float] | None:
        """Gains K_ap (N/m) and K_av (N s/m) of the controller; None if it has none, or they are not valid numbers."""
        fields = read_component(self.controller)
        position = fields.get("position_gain")
        velocity = fields.get("velocity_gain")
        if not (isinstance(position, int | float) and isinstance(velocity, int | float)):
            return None
        return (position, velocity) if position > 0 and velocity >= 0 else None

    @property
    def nominal(self) -> "Config":
        """Nominal config for all components except the plant: no disturbances of ground, payload or plant."""
        ground = replace(self.terrain, stiffness=self.assumed_stiffness, patch_spread=0.0, slope=0.0)
        ground = replace(ground, step_time=None, step_factor=1.0)
        plant = {"_target_": read_component(self.plant)["_target_"]}
        return replace(self, terrain=ground, payload=replace(self.payload, weight=0.0), plant=plant)

    @property
    def assumed_stiffness(self) -> float:
        """Ground stiffness that planner and controller use, N/m."""
        return self.terrain.assumed_stiffness or self.terrain.stiffness
