"""Controllers: hybrid position/force feedback, and commands to joint drives that close their own loops.

Joint drives receive angles, velocities, gains and torques.
"""

import math
from dataclasses import dataclass, field

import numpy as np

from cmacexp.config import ComponentConfig, Config, number
from cmacexp.control.drive_kernels import DriveParams, command_drives
from cmacexp.control.hybrid_kernels import (
    METHODS,
    FaultDetection,
    HybridParams,
    HybridState,
    hybrid_feedback,
    new_hybrid_state,
)
from cmacexp.control.steering import new_steering, steer
from cmacexp.errors import BadInput, require
from cmacexp.models.lead import discretise
from cmacexp.models.loop_delay import first_order_share
from cmacexp.models.mechanism import KINEMATICS_FIELDS, update_kinematics
from cmacexp.planning.plan import Reference, Setup
from cmacexp.planning.reference import make_gains
from cmacexp.plants.drives import ANGLE, DAMPING, STIFFNESS, VELOCITY
from cmacexp.protocols import Action, Drive, Feedforward, HasEstimator, Measurement, get_state, offers
from cmacexp.sensors.config import RealSensorsConfig
from cmacexp.sensors.kernels import Observation
from cmacexp.sensors.proprioceptive import ProprioceptiveConfig
from cmacexp.typing import Array


class HybridController:
    """Hybrid controller: position control in transfer, force control of feet in support (Lin & Song 1997, eq. 21)."""

    @dataclass
    class Config(ComponentConfig):
        """Gains of position control and corner frequencies of the LEAD compensator (eq. 5-7, 21)."""

        position_gain: float = number("N/m", above=0, at_most=1e9)
        """Position gain K_ap."""
        velocity_gain: float = number("N s/m", at_least=0, at_most=1e9)
        """Velocity gain K_av."""
        lead_omega: float = number("rad/s", above=0, at_most=1e6)
        """Lower corner frequency omega of the LEAD (assumed; see pipelines/lead_design.py)."""
        lead_alpha: float = number("", above=0, at_most=1e6)
        """Ratio alpha of upper to lower corner frequency of the LEAD (assumed)."""
        lead_gain: float = number("", above=0, at_most=1e6, default=1.0)
        """Gain K_c of the LEAD at low frequency (assumed)."""
        lead_reset: bool = field(default=False, kw_only=True)
        """Set the LEAD states to zero when the planned phase of a leg changes (assumed)."""

    params: HybridParams
    state: HybridState = new_hybrid_state(0)
    """LEAD and fault detection states; no legs until the controller is reset."""
    feedforward: Feedforward

    def __init__(self, config: Config):
        self.config = config

    def reset(self, setup: Setup, feedforward: Feedforward) -> None:
        """Prepare the controller for a run, with the LEAD states at zero; it trains and uses ``feedforward``."""
        self.params = HybridParams(
            mechanism=setup.mechanism,
            method=METHODS[setup.config.force_control.method],
            gains=make_gains(setup.config, self.config.position_gain, self.config.velocity_gain),
            lead=discretise(
                self.config.lead_omega, self.config.lead_alpha, setup.config.sampling_period, self.config.lead_gain
            ),
            lead_reset=self.config.lead_reset,
            force_in_transfer=setup.config.force_control.has_force_in_transfer,
            posture_gain=setup.config.posture.gain,
            posture_rate_gain=setup.config.posture.rate_gain,
            fault_detection=FaultDetection(**vars(setup.config.plausibility)),
            steering=new_steering(setup),
        )
        self.state = new_hybrid_state(*setup.mechanism.shape)
        self.kinematics = np.zeros((setup.mechanism.shape[0], KINEMATICS_FIELDS[setup.mechanism.axes]))
        self.feedforward = feedforward

    @property
    def force_trusted(self) -> Array:
        """(L,): 1 if the force sensor of the leg is trusted, 0 after its exclusion; without a unit."""
        return self.state.fault_status.trusted

    @property
    def dropped(self) -> dict[int, int]:
        """Step in which a force sensor was excluded, by leg number from 1."""
        status = self.state.fault_status
        return {i + 1: int(status.steps[i]) for i in np.flatnonzero(status.trusted == 0.0).tolist()}

    def act(self, reference: Reference, measurement: Measurement) -> Action:
        """Compute feedback from the errors of this step, and feedforward trained by the feedback of the last step.

        The feedforward is zero outside the cycles in which it acts.
        """
        last: Array = self.state.learning_error.copy()
        update_kinematics(self.params.mechanism, measurement.q, self.kinematics)
        observation = Observation._make((*get_state(measurement), self.kinematics, measurement.travel))
        steer(self.params.steering, observation.travel, reference.step, reference.sample, reference.support)
        hybrid_feedback(self.params, self.state, reference.support, reference.control, observation)
        feedforward = self.feedforward.predict(reference, last) if reference.acting else np.zeros_like(last)
        return Action(self.state.feedback.copy(), feedforward, self.state.reference.copy())


class DriveController:
    """Controller of joint drives: sends the planned joint motion, and J^T F_d in support.

    The drives compute the feedback K (q_d - q) + D (dq_d - dq). The force error in support enters the learning error
    only: there is no force feedback.
    """

    @dataclass
    class Config(ComponentConfig):
        """Gains of the joint drives, and weight of the force in the learning error."""

        stiffness: float = number("N m/rad", above=0, at_most=1e6)
        """Position gain K of every joint drive."""
        damping: float = number("N m s/rad", above=0, at_most=1e5)
        """Velocity gain D of every joint drive; above ``actuator.lag`` times the stiffness."""
        force_weight: float = number("", at_least=0, at_most=10)
        """Weight of J^T (F_d - F) in support in the learning error; 0: feedback torque of the drives only."""

        def check(self, config: Config) -> None:
            """Check that the drives are stable with their lag, and that the method needs no force feedback.

            Stability follows from Routh's criterion for a joint without friction. Raises BadInput.
            """
            least = config.actuator.lag * self.stiffness
            require(
                self.damping > least,
                "controller.damping",
                self.damping,
                f"must be above actuator.lag times controller.stiffness, {least:.4g}, or joints shake",
            )
            force = config.force_control
            require(
                force.method in ("stiffness", "combined"),
                "force_control.method",
                force.method,
                "must be stiffness or combined with controller=drives: other plans have no depth to follow",
            )
            reason = "must be 0 with controller=drives: the reference would give way to a force that none reads"
            for name, value in (("elasticity", force.elasticity), ("admittance", force.admittance)):
                require(value == 0.0, f"force_control.{name}", value, reason)

    sends_drives = True
    response = 1
    """Samples from torque to learning error besides delays and lags: the drives respond to motion, not to torque."""
    state: HybridState = new_hybrid_state(0)
    params: DriveParams
    feedforward: Feedforward

    def __init__(self, config: Config):
        self.config = config

    def reset(self, setup: Setup, feedforward: Feedforward) -> None:
        """Prepare the commands for a run; raises BadInput if the machine is not a robot."""
        if setup.mechanism.chains is None:
            kind = setup.config.machine.kind
            raise BadInput("machine.kind", kind, "must be robot with controller=drives: use scenario=robot")
        plant = setup.config.plant
        sensors = plant.estimator if offers(plant, HasEstimator) else setup.config.sensors
        delays = (
            [sensors.position.delay, sensors.velocity.delay]
            if isinstance(sensors, RealSensorsConfig | ProprioceptiveConfig)
            else [0, 0]
        )
        force_lag = sensors.force_lag if isinstance(sensors, ProprioceptiveConfig) else 0.0
        self.params = DriveParams(
            hips=setup.mechanism.hips,
            chains=setup.mechanism.chains,
            angles=setup.plan.joints.position.copy(),  # an adaptive plan changes its own array
            behind=np.stack([v - np.roll(v, n, axis=0) for v, n in zip(setup.plan.joints[:2], delays, strict=True)]),
            stiffness=self.config.stiffness,
            damping=self.config.damping,
            force_weight=self.config.force_weight,
            force_share=first_order_share(force_lag, setup.config.sampling_period),
            force_due=np.zeros(setup.mechanism.chains.shape[0]),
            ahead=setup.config.sampling_period / 2.0,
            steering=new_steering(setup),
        )
        legs, joints = setup.mechanism.shape
        self.state = new_hybrid_state(legs, joints)
        self.command = np.zeros((6, legs, joints))
        self.kinematics = np.full((legs, KINEMATICS_FIELDS[setup.mechanism.axes]), math.nan)
        self.feedforward = feedforward

    def act(self, reference: Reference, measurement: Measurement) -> Action:
        """Compute the drive command of this step, and feedforward trained by the learning error of the last step.

        The feedforward is zero outside the cycles in which it acts.
        """
        last: Array = self.state.learning_error.copy()
        observation = Observation._make((*get_state(measurement), self.kinematics, measurement.travel))
        steer(self.params.steering, observation.travel, reference.step, reference.sample, reference.support)
        command_drives(
            self.params,
            self.state,
            self.command,
            reference.sample,
            reference.support,
            reference.control,
            observation,
        )
        feedforward = self.feedforward.predict(reference, last) if reference.acting else np.zeros_like(last)
        drive = Drive(*(self.command[quantity].copy() for quantity in (ANGLE, VELOCITY, STIFFNESS, DAMPING)))
        state = self.state
        return Action(state.feedback.copy(), feedforward, state.reference.copy(), drive, state.learning_error.copy())
