"""Parts of a loop: state and parameters of every component, and the hooks that call external ones."""

from typing import NamedTuple

from cmacexp.control.actuator import Actuator
from cmacexp.control.drive_kernels import DriveParams
from cmacexp.control.hybrid_kernels import HybridParams, HybridState
from cmacexp.control.load_meter import LoadMeter
from cmacexp.feedforward.kernels import FeedforwardParams
from cmacexp.jit.hooks import Hook
from cmacexp.loop.guard_kernels import Flag, GuardState
from cmacexp.loop.stop import StopLimits
from cmacexp.models.mechanism import Mechanism
from cmacexp.planning.reference import ControlReference
from cmacexp.plants.drives import Drives
from cmacexp.plants.kernels import PlantParams, PlantState
from cmacexp.plants.mujoco_kernels import Engine
from cmacexp.protocols import RobotSignals
from cmacexp.sensors.estimator import Proprioception
from cmacexp.sensors.kernels import Observation, Sensing
from cmacexp.typing import Array, Mask, Scratch


class Torques(NamedTuple):
    """Torques of one step, (L, J) each, N m."""

    feedforward: Scratch
    total: Scratch


class LoopPlan(NamedTuple):
    """The part of a plan that the loop reads."""

    support: Mask
    """(N, L): planned phase by sample of the cycle, True in support."""
    reference: ControlReference
    """Planned references of the controller by sample of the cycle."""
    start_step: int
    """First step in which the feedforward acts."""


class PlantPart(NamedTuple):
    """State and parameters of a plant."""

    state: PlantState
    params: PlantParams | Engine | None = None
    """The type chooses the function that advances the plant; None for an external plant, which fills ``state``."""
    travel: Array | None = None
    """(3,): true position and yaw of a body that the plant moves, m and rad, as in a Measurement."""
    signals: RobotSignals | None = None
    """Onboard signals of a robot."""


class SensorPart(NamedTuple):
    """Output and parameters of sensors."""

    observation: Observation
    """Input of the controller; with sensors that alter nothing it shares the arrays of the plant."""
    params: Sensing | Proprioception | None = None
    """The type chooses the function that measures; None for external sensors and for those that alter nothing."""


class ControlPart(NamedTuple):
    """State and parameters of a controller."""

    state: HybridState
    params: HybridParams | DriveParams | None = None
    """The type chooses the control law; None for an external controller."""


class Loop(NamedTuple):
    """All parts of a loop: one for each component, and what lies between them."""

    plan: LoopPlan
    mechanism: Mechanism
    plant: PlantPart
    sensors: SensorPart
    controller: ControlPart
    feedforward: FeedforwardParams | None
    """None for an external feedforward, and for one that an external controller calls."""
    guard: GuardState | None
    """State of the guard of learning; None without a guard."""
    actuator: Actuator
    drives: Drives | None
    """Drives between controller and plant; None if the plant is commanded by torques."""
    torques: Torques
    limits: StopLimits
    meter: LoadMeter | None
    """Load meter; None if the plan does not adapt to the load."""
    shows: Flag
    """(1,): 1 while the observer requests further steps, else 0."""


class Hooks(NamedTuple):
    """Hooks into Python, called with the number of the step; None for built-in components."""

    guard: Hook | None = None
    """The guard of learning, at the start of a cycle and after an alarm."""
    sensors: Hook | None = None
    """External sensors, which fill ``observation``."""
    observer: Hook | None = None
    """External feedforward that observes the steps."""
    controller: Hook | None = None
    """External controller, which fills the torques of feedback and feedforward (it calls its feedforward itself)."""
    feedforward: Hook | None = None
    """External feedforward, which fills the torque of a step or of a block; called where it acts and learns."""
    plant: Hook | None = None
    """External plant, which fills ``plant_state``."""
