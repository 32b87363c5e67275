"""The hybrid position/force controller."""

from dataclasses import dataclass

import numpy as np

from cmacexp.config import ComponentConfig, number
from cmacexp.control.fault_detection import FaultDetection
from cmacexp.control.hybrid_kernels import METHODS, HybridParams, HybridState, hybrid_feedback, new_hybrid_state
from cmacexp.control.protocol import Action
from cmacexp.control.steering import new_steering, steer
from cmacexp.feedforward.protocol import Feedforward
from cmacexp.models.lead import discretise
from cmacexp.models.mechanism import KINEMATICS_FIELDS, update_kinematics
from cmacexp.planning.reference import make_gains
from cmacexp.planning.setup import Reference, Setup
from cmacexp.plants.protocol import Measurement, get_state
from cmacexp.sensors.kernels import Observation
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
    """Of no legs until the controller is reset."""
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
