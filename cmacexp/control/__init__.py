"""What controls: hybrid position/force feedback, and feedforwards."""

from cmacexp.control.feedforward import CmacFeedforward, InverseDynamics, NoFeedforward
from cmacexp.control.hybrid import HybridController
from cmacexp.control.iterative import IterativeLearning
from cmacexp.control.perceptron import Perceptron
from cmacexp.control.protocol import Action, Controller, Feedforward, Learns, Reference
from cmacexp.control.radial import RadialBasis

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
