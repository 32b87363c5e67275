"""The configuration of a run: one dataclass per group, unit and range beside every field.

Values stand in ``conf/``, never here. *Assumed* marks what Lin & Song 1997 do not give.
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
"""What the seed needs: something that draws random numbers."""
RATES = ("gait.pattern != 'standing' or gait.load_ramp > 0 or gait.unload_ramp > 0 or terrain.damping > 0",)
"""What rates of the depression need: a force that changes, or ground that resists them."""


NEEDS_MOTION = ("machine.kind != 'point_mass' or gait.stroke > 0 or option.sensors != 'perfect'",)
"""What a slope needs: a point mass that stands on its spot meets the ground at one height."""


@dataclass
class TerrainConfig:
    """Elastic ground (Lin & Song 1997, eq. 1). The plan knows its stiffness, with ``load_rate`` its damping too."""

    stiffness: float = number("N/m", at_least=1e-3, at_most=1e9)
    """K_n, the stiffness that the plant feels."""
    assumed_stiffness: float | None = number("N/m", at_least=1e-3, at_most=1e9)
    """The K_n that planner and controller assume; null: the true one, before any step of it."""
    patch_size: float = number("m", at_least=1e-3, needs=("own.patch_spread > 0",))
    """Side of the square patches of the ground."""
    patch_spread: float = number("", at_least=0, below=1)
    """Each patch has K_n times a factor between 1 - spread and 1 + spread; 0: the same everywhere."""
    patch_seed: int = number("", at_least=0, below=2**32, needs=("own.patch_spread > 0",))
    """Seed of the patches."""
    damping: float = number("N s/m", at_least=0, at_most=1e9)
    """Force of the ground over the speed at which it is pressed in; 0 as in the paper. The ground never pulls."""
    step_time: float | None = number("s", at_least=0, needs=("own.step_factor != 1",))
    """When the stiffness steps; null: never."""
    step_factor: float = number("", at_least=1e-3, at_most=1e3, needs=("own.step_time is not None",))
    """K_n after the step over that before it."""
    step_legs: list[int] | None = number(
        "", at_least=1, at_most=4, needs=("own.step_time is not None", "own.step_factor != 1", *HAS_BODY)
    )
    """Legs under which it steps, by their numbers; null: all."""
    slope: float = number("", above=-1, below=1, needs=NEEDS_MOTION)
    """Rise of the ground over distance, m/m; 0: flat. Its vertical stiffness is that of flat ground."""
    slope_start: float = number("m", needs=("own.slope != 0", *NEEDS_MOTION))
    """Where the slope begins, x in the world; flat before. The body's centre starts at 0."""


@dataclass
class PayloadConfig:
    """A weight that is put on the body during a run; planner and controller do not know of it."""

    weight: float = number("N", at_least=0)
    """Weight of the payload; 0: none."""
    x: float = number("m", needs=("own.weight > 0",))
    """Where it lies on the body, forward of its centre, in the plane of the hips."""
    y: float = number("m", needs=("own.weight > 0",))
    """Where it lies on the body, to the left."""
    time: float = number("s", at_least=0, needs=("own.weight > 0",))
    """When it is put there."""


@dataclass
class ActuatorConfig:
    """How the actuators turn the commanded torque into the one that acts."""

    torque_limit: float | None = number("N m (N for a point mass)", above=0)
    """Largest absolute torque of each joint; null: none."""
    rate_limit: float | None = number("N m/s (N/s for a point mass)", above=0)
    """Fastest change of the torque of each joint; null: none."""
    delay: int = number("samples", at_least=0)
    """A torque that is commanded at step k acts from step k + delay."""
    lag: float = number("s", at_least=0, at_most=1e3)
    """Time constant with which the torque then follows the limited command, as a first-order lag; 0: none."""

    @property
    def limit(self) -> float:
        """The largest absolute torque, infinite if there is none."""
        return float("inf") if self.torque_limit is None else self.torque_limit


STEERED = ("machine.kind == 'robot'", "gait.stroke > 0")
"""What keeping a course needs."""
HYBRID = ("option.controller != 'drives'",)
"""What the posture of a body and checks of force sensors need; loops in drives hold it, and read no force."""


@dataclass
class PostureConfig:
    """Posture control of a body (Lin & Song 1997, section 6.2)."""

    needs: ClassVar[tuple[str, ...]] = HAS_BODY

    gain: float = number("", at_least=0, needs=HYBRID)
    """Depth that a supporting foot is pushed down, over the height that its hip lacks; 0 switches it off."""
    rate_gain: float = number("", at_least=0, needs=HYBRID)
    """Speed at which a supporting foot is pushed down, over the speed at which its hip sinks; 0 as in the paper."""
    course_gain: float = number("1/s", at_least=0, at_most=100, needs=STEERED)
    """Speed of a robot towards its planned place, over the distance from it; 0 switches it off."""
    heading_gain: float = number("1/s", at_least=0, at_most=100, needs=STEERED)
    """Rate of turning of a robot towards its planned heading, over the deviation from it; 0 switches it off."""


@dataclass
class ForceControlConfig:
    """Force control in the support phase (Lin & Song 1997, eq. 8-15)."""

    method: str = choice("stiffness", "damping", "combined", "explicit")
    """What the force error changes: depth (stiffness), speed (damping), both (combined), or the force (explicit)."""
    desired_force: float | None = number("N", above=0)
    """Force to press with in support, F_d; null under a body, whose weight is shared out among the feet."""
    elasticity: float = number("m/N", at_least=0, at_most=1e6, needs=("own.method in ('stiffness', 'combined')",))
    """Depth that the reference gives way per force error, P_fn."""
    admittance: float = number("m/(N s)", at_least=0, at_most=1e6, needs=("own.method in ('damping', 'combined')",))
    """Speed at which the reference gives way per force error, V_fn."""
    force_gain: float = number("", above=0, at_most=1e9, needs=("own.method == 'explicit'",))
    """K_a of explicit force control; stiffness uses K_ap and damping K_av for K_a."""
    load_sharing: str = choice("static", "dynamic", ADAPTIVE, needs=HAS_BODY)
    """What the feet of a body share; static: its weight, as in the paper; dynamic: gravity, inertia of all masses;
    adaptive: also what they carried in the last cycle beyond that, on ground with the slope that they met."""
    load_rate: bool = field(kw_only=True, metadata={"needs": (*RATES, "own.method != 'explicit'")})
    """Whether the reference in support contains the rate of the depression for F_d, and its lag on damped ground."""


@dataclass
class PlausibilityConfig:
    """Fault detection: whether the controller checks its force sensors, and ignores those that are implausible."""

    needs: ClassVar[tuple[str, ...]] = HYBRID

    enabled: bool
    """Whether it is on."""
    tolerance: float = number("N", above=0, at_most=1e9, needs=("own.enabled",))
    """Largest plausible difference from the force expected at the measured depth."""
    relative_tolerance: float = number("", at_least=0, below=1, needs=("own.enabled",))
    """The same over the expected force; at 1 a sensor stuck at zero would pass."""
    patience: int = number("samples", at_least=1, at_most=10**6, needs=("own.enabled",))
    """A sensor is ignored for good after so many readings that are wrong by twice the tolerance."""


@dataclass
class LearningConfig:
    """The learning rule (Lin & Song 1997, eq. 19, 20) and the strengths of the others."""

    needs: ClassVar[tuple[str, ...]] = ("option.feedforward != 'none'",)

    rule: str = field(kw_only=True, metadata={"needs": NEEDS_LEARNING})
    """One of cmacexp/cmac/rules.py; each but the paper's has its strength in a field below."""
    rate: float | str = number("", above=0, below=2, words=(AUTO,), needs=NEEDS_LEARNING, tuned=(0.05, 1.5))
    """Fraction of the error that a step corrects, beta; 50/256 in the paper; auto: that over 2 x lead - 1."""
    lead: int | float | str = number(
        "samples", at_least=-100, at_most=100, words=(AUTO, ESTIMATE), needs=NEEDS_LEARNING
    )
    """U(k-1) trains the cells of step k-1-lead; 0 as in the paper; auto: the samples from torque to feedback, as
    actuator and sensors declare them; estimate: as a small torque shows them before learning."""
    guard: str = choice(*GUARDS, needs=NEEDS_LEARNING)
    """What happens when learning does harm: nothing; the torque of the best cycle is repeated; or it is repeated and
    improved once a cycle, by the paper's rule."""
    start_cycle: int = number("", at_least=1, at_most=10**9, needs=("own.start_from is None",))
    """First cycle in which the feedforward learns and acts; with a guard the second at least. What another run has
    learnt acts from the first cycle on. Above the cycles of the run nothing learns or acts."""
    start_from: str | None = field(kw_only=True, metadata={"needs": NEEDS_LEARNING})
    """Folder of a run with record.weights, from whose weights the feedforward starts; null: none."""
    regularisation: float = number("", at_least=0, at_most=1e6)
    """normalised: added to sum a_i^2, as a fraction of its mean along the plan; 0: the paper's rule."""
    dead_zone: float = number("N m", at_least=0)
    """dead_zone: feedback up to this changes no weight; 0: the paper's rule."""
    leakage: float = number("", at_least=0, at_most=1)
    """leakage, zero_phase: fraction that an active weight loses in each step, over beta; 0: none."""
    e_modification: float = number("1/(N m)", at_least=0, at_most=1e6)
    """e_modification: leakage over |U|; the output stays within its inverse; 0: the paper's rule."""
    smoothing: float = number("", at_least=0, at_most=1)
    """weight_smoothing: fraction of its way to the mean of the active ones, over beta; kappa of Macnab 2017."""
    window: int = number("samples", at_least=0, at_most=10**4)
    """zero_phase: samples to each side that an error trains, with binomial weights; 0: only leakage."""
    decay: float = number("cycles", above=0, at_most=1e9)
    """decaying_rate: cycles of learning after which the rate is half of beta; after twice as many a third."""


@dataclass
class RecordConfig:
    """What a run keeps besides its metrics."""

    trace: bool
    """Write the traces, the metrics as CSV too, and Hydra's own record; false: only metrics and manifest."""
    recording: bool
    """Write recording.rrd, the Rerun view."""
    weights: bool
    """Write weights.npz, what the feedforward has learnt at the end."""
    every_nth_step: int = number("steps", at_least=1, at_most=10**9)
    """Keep every n-th step in the traces, and the last 100 of a run that does not complete; metrics use all steps."""
    cycles: list[int] | None = number("cycle", at_least=1, at_most=10**9)
    """Keep these cycles in the traces, and the same last steps; null: all. Metrics use all cycles."""

    @property
    def thins(self) -> bool:
        """Whether the traces lack some of the steps."""
        return self.every_nth_step > 1 or self.cycles is not None


@dataclass
class SweepConfig:
    """How a sweep runs its jobs."""

    resume: bool
    """Do not run jobs again whose results are in the folder of the sweep."""
    chunk: int | None = number("jobs", at_least=1)
    """Jobs in each task of a launcher such as ``submitit_slurm``; null: one."""


def read_component(component: Any) -> dict[str, Any]:
    """The fields of a component of a config: it is a ``Config`` of its class, or a dictionary where that has none."""
    return component if isinstance(component, dict) else vars(component)


def count_steps(cycle_time: float, sampling_period: float) -> int:
    """Samples of one cycle, N = T / T_s."""
    return round(cycle_time / sampling_period)


@dataclass
class Config:
    """All fields of a run."""

    scenario: str
    """Option of conf/scenario that the run is based on."""
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
    """Metric whose final value a job returns to the sweeper (see cmacexp/engine/objective.py); null: none."""
    warn: bool
    """Warn of overrides without effect (see cmacexp/engine/without_effect.py)."""
    cycles: int = number("", at_least=1, at_most=10**9)
    """Gait cycles after which the run ends."""
    seed: int = number("", at_least=0, below=2**32, needs=NEEDS_DRAWS)
    """Seed of the hash of the CMAC's memory and of every component that draws random numbers."""
    sampling_period: float = number("s", at_least=1e-6, at_most=1e3)
    """Time between two steps of the loop, T_s."""
    reference: str = choice("literal", "aware", "force_feedforward")
    """literal: eq. 9, 11, 13, 15 always; aware: without their 1/K_a term while a feedforward acts;
    force_feedforward: the desired force is added to the feedback instead."""

    @property
    def steps_per_cycle(self) -> int:
        """Samples of one cycle, N = T / T_s."""
        return count_steps(self.gait.cycle_time, self.sampling_period)

    @property
    def first_learning(self) -> int:
        """First cycle in which the feedforward acts; with weights of an earlier run it is the first one."""
        return self.learning.start_cycle if self.learning.start_from is None else 1

    @property
    def legs(self) -> int:
        """Number of legs."""
        return PATTERNS[self.gait.pattern].legs

    @property
    def joints(self) -> int:
        """Joints of a leg; of a point mass its two axes, which stand in their place."""
        return JOINTS if isinstance(self.machine, RobotMachine) else 2

    @property
    def has_body(self) -> bool:
        """Whether the machine is a body on legs."""
        return isinstance(self.machine, BodyMachine)

    @property
    def body_speed(self) -> float:
        """Speed of a body over the ground, stroke / (duty factor x T), m/s; 0 without a body."""
        return self.gait.stroke / (self.gait.duty_factor * self.gait.cycle_time) if self.has_body else 0.0

    @property
    def gains(self) -> tuple[float, float] | None:
        """K_ap (N/m) and K_av (N s/m) of the controller; None if it has no such fields, or no such numbers."""
        fields = read_component(self.controller)
        position, velocity = fields.get("position_gain"), fields.get("velocity_gain")
        if not (isinstance(position, int | float) and isinstance(velocity, int | float)):
            return None
        return (position, velocity) if position > 0 and velocity >= 0 else None

    @property
    def nominal(self) -> "Config":
        """What the designer believes: the config for everything but the plant, which alone knows the truth."""
        ground = replace(self.terrain, stiffness=self.assumed_stiffness, patch_spread=0.0, slope=0.0)
        ground = replace(ground, step_time=None, step_factor=1.0)
        plant = {"_target_": read_component(self.plant)["_target_"]}
        return replace(self, terrain=ground, payload=replace(self.payload, weight=0.0), plant=plant)

    @property
    def assumed_stiffness(self) -> float:
        """K_n that planner and controller assume, N/m."""
        return self.terrain.assumed_stiffness or self.terrain.stiffness
