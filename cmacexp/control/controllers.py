"""The controllers: hybrid position/force feedback, and drives that close loops of their own.

Drives are sent angles, velocities, gains and torques.
"""

import math
from dataclasses import dataclass

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
from cmacexp.typing import Array, KernelParts


class HybridController:
    """Position control, and force control of the feet that the plan has in support (Lin & Song 1997, eq. 21)."""

    @dataclass
    class Config(ComponentConfig):
        """Position control and the LEAD compensator (eq. 5-7, 21)."""

        position_gain: float = number("N/m", above=0, at_most=1e9)
        """K_ap."""
        velocity_gain: float = number("N s/m", at_least=0, at_most=1e9)
        """K_av."""
        lead_omega: float = number("rad/s", above=0, at_most=1e6)
        """Lower corner frequency omega (assumed; see pipelines/lead_design.py)."""
        lead_alpha: float = number("", above=0, at_most=1e6)
        """Upper over lower corner frequency, alpha (assumed)."""

    params: HybridParams
    state: HybridState = new_hybrid_state(0)
    """State of no legs until the controller is reset."""
    feedforward: Feedforward

    def __init__(self, config: Config):
        self.config = config

    def reset(self, setup: Setup, feedforward: Feedforward) -> None:
        """Set the states of the LEAD compensators to zero."""
        self.params = HybridParams(
            mechanism=setup.mechanism,
            method=METHODS[setup.config.force_control.method],
            gains=make_gains(setup.config, self.config.position_gain, self.config.velocity_gain),
            lead=discretise(self.config.lead_omega, self.config.lead_alpha, setup.config.sampling_period),
            posture_gain=setup.config.posture.gain,
            posture_rate_gain=setup.config.posture.rate_gain,
            fault_detection=FaultDetection(**vars(setup.config.plausibility)),
            steering=new_steering(setup),
        )
        self.state = new_hybrid_state(*setup.mechanism.shape)
        self.kinematics = np.zeros((setup.mechanism.shape[0], KINEMATICS_FIELDS[setup.mechanism.axes]))
        self.feedforward = feedforward

    def kernel_parts(self) -> KernelParts:
        """Parameters and state."""
        return {"control": self.params, "control_state": self.state}

    @property
    def force_trusted(self) -> Array:
        """(L,): 1, or 0 since the force sensor of the leg was excluded; without a unit."""
        return self.state.fault_status.trusted

    @property
    def dropped(self) -> dict[int, int]:
        """Legs whose force sensor was excluded, and the step in which it was."""
        status = self.state.fault_status
        return {i + 1: int(status.steps[i]) for i in np.flatnonzero(status.trusted == 0.0).tolist()}

    def act(self, reference: Reference, measurement: Measurement) -> Action:
        """Feedback from this step's errors; feedforward from the plan, trained by the last step's feedback."""
        last: Array = self.state.learning_error.copy()
        update_kinematics(self.params.mechanism, measurement.q, self.kinematics)
        observation = Observation._make((*get_state(measurement), self.kinematics, measurement.travel))
        steer(self.params.steering, observation.travel, reference.step, reference.sample, reference.support)
        hybrid_feedback(self.params, self.state, reference.support, reference.control, observation)
        feedforward = self.feedforward.predict(reference, last) if reference.acting else np.zeros_like(last)
        return Action(self.state.feedback.copy(), feedforward, self.state.reference.copy())


class DriveController:
    """Sends drives the planned motion of their joints, and in support J^T F_d; the drives give K (q_d - q) + D (...).

    The force that is missing in support enters what teaches, and no feedback: the law reads no force in between.
    """

    @dataclass
    class Config(ComponentConfig):
        """Gains of the drives, and what teaches."""

        stiffness: float = number("N m/rad", above=0, at_most=1e6)
        """K of every joint, which its drive applies."""
        damping: float = number("N m s/rad", above=0, at_most=1e5)
        """D of every joint; above ``actuator.lag`` times the stiffness."""
        force_weight: float = number("", at_least=0, at_most=10)
        """Weight of J^T (F_d - F) in support, in what teaches, beside what the drives' law gives; 0: that alone."""

        def check(self, config: Config) -> None:
            """Check that drives are stable behind their lag (Routh, a joint without friction); raises BadInput."""
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
    """Samples that pass beyond delays and lags until a torque shows in what teaches: the law answers a motion."""
    state: HybridState = new_hybrid_state(0)
    params: DriveParams
    feedforward: Feedforward

    def __init__(self, config: Config):
        self.config = config

    def reset(self, setup: Setup, feedforward: Feedforward) -> None:
        """Prepare the commands of a robot; raises BadInput of another machine."""
        if setup.mechanism.chains is None:
            kind = setup.config.machine.kind
            raise BadInput("machine.kind", kind, "must be robot with controller=drives: use scenario=robot")
        planned = setup.plan.joints[:2]
        sensors = setup.config.sensors
        if offers(setup.config.plant, HasEstimator):
            sensors = setup.config.plant.estimator
        late = [0, 0]
        if isinstance(sensors, RealSensorsConfig | ProprioceptiveConfig):
            late = [sensors.position.delay, sensors.velocity.delay]
        lag = sensors.force_lag if isinstance(sensors, ProprioceptiveConfig) else 0.0
        self.params = DriveParams(
            hips=setup.mechanism.hips,
            chains=setup.mechanism.chains,
            angles=setup.plan.joints.position.copy(),  # a plan that adapts changes its own
            behind=np.stack([v - np.roll(v, n, axis=0) for v, n in zip(planned, late, strict=True)]),
            stiffness=self.config.stiffness,
            damping=self.config.damping,
            force_weight=self.config.force_weight,
            force_share=first_order_share(lag, setup.config.sampling_period),
            force_due=np.zeros(setup.mechanism.chains.shape[0]),
            ahead=setup.config.sampling_period / 2.0,
            steering=new_steering(setup),
        )
        legs, joints = setup.mechanism.shape
        self.state = new_hybrid_state(legs, joints)
        self.command = np.zeros((6, legs, joints))
        self.kinematics = np.full((legs, KINEMATICS_FIELDS[setup.mechanism.axes]), math.nan)
        self.feedforward = feedforward

    def kernel_parts(self) -> KernelParts:
        """Parameters and state."""
        return {"control": self.params, "control_state": self.state}

    def act(self, reference: Reference, measurement: Measurement) -> Action:
        """The command of this step; feedforward from the plan, trained by the last step's learning error."""
        last: Array = self.state.learning_error.copy()
        observation = Observation._make((*get_state(measurement), self.kinematics, measurement.travel))
        steer(self.params.steering, observation.travel, reference.step, reference.sample, reference.support)
        control, sample = reference.control, reference.sample
        command_drives(self.params, self.state, self.command, sample, reference.support, control, observation)
        feedforward = self.feedforward.predict(reference, last) if reference.acting else np.zeros_like(last)
        drive = Drive(*(self.command[part].copy() for part in (ANGLE, VELOCITY, STIFFNESS, DAMPING)))
        state = self.state
        return Action(state.feedback.copy(), feedforward, state.reference.copy(), drive, state.learning_error.copy())
