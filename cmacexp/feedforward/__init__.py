"""Feedforwards: torque known from the plan, or learnt from the feedback."""

from cmacexp.feedforward.cmac import CmacFeedforward, CmacOnModel
from cmacexp.feedforward.identified import IdentifiedModel
from cmacexp.feedforward.ilc import IterativeLearning
from cmacexp.feedforward.inverse_dynamics import InverseDynamics
from cmacexp.feedforward.network import NoFeedforward
from cmacexp.feedforward.rbf import RadialBasis
from cmacexp.protocols import Feedforward, Learns, Observes, Plays

__all__ = [
    "CmacFeedforward",
    "CmacOnModel",
    "Feedforward",
    "IdentifiedModel",
    "InverseDynamics",
    "IterativeLearning",
    "Learns",
    "NoFeedforward",
    "Observes",
    "Plays",
    "RadialBasis",
]
