"""What controls: hybrid position/force feedback, and feedforwards."""

from cmacexp.control.hybrid import HybridController
from cmacexp.control.protocol import Action, Controller
from cmacexp.feedforward.cmac import CmacFeedforward
from cmacexp.feedforward.ilc import IterativeLearning
from cmacexp.feedforward.inverse_dynamics import InverseDynamics
from cmacexp.feedforward.mlp import Perceptron
from cmacexp.feedforward.none import NoFeedforward
from cmacexp.feedforward.protocol import Feedforward, Learns
from cmacexp.feedforward.rbf import RadialBasis
from cmacexp.planning.setup import Reference

__all__ = [
    "Action",
    "CmacFeedforward",
    "Controller",
    "Feedforward",
    "HybridController",
    "InverseDynamics",
    "IterativeLearning",
    "Learns",
    "NoFeedforward",
    "Perceptron",
    "RadialBasis",
    "Reference",
]
