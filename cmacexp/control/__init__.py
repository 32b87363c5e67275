"""What controls: hybrid position/force feedback, and feedforwards."""

from cmacexp.control.feedforward import CmacFeedforward, InverseDynamics, NoFeedforward
from cmacexp.control.hybrid import HybridController
from cmacexp.control.iterative import IterativeLearning
from cmacexp.control.protocol import Action, Controller, Feedforward, Reference

__all__ = [
    "Action",
    "CmacFeedforward",
    "Controller",
    "Feedforward",
    "HybridController",
    "InverseDynamics",
    "IterativeLearning",
    "NoFeedforward",
    "Reference",
]
