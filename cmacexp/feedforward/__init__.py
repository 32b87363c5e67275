"""Feedforwards: torque that is known from the plan, or learnt from the feedback."""

from cmacexp.feedforward.cmac import CmacFeedforward
from cmacexp.feedforward.cmac_on_model import CmacOnModel
from cmacexp.feedforward.ilc import IterativeLearning
from cmacexp.feedforward.inverse_dynamics import InverseDynamics
from cmacexp.feedforward.none import NoFeedforward
from cmacexp.feedforward.protocol import Feedforward, Learns, Observes
from cmacexp.feedforward.rbf import RadialBasis

__all__ = [
    "CmacFeedforward",
    "CmacOnModel",
    "Feedforward",
    "InverseDynamics",
    "IterativeLearning",
    "Learns",
    "NoFeedforward",
    "Observes",
    "RadialBasis",
]
