"""Hybrid position/force feedback, and the feedforwards under their former names."""

from cmacexp.control.hybrid import HybridController
from cmacexp.control.protocol import Action, Controller
from cmacexp.feedforward import (
    CmacFeedforward,
    Feedforward,
    InverseDynamics,
    IterativeLearning,
    Learns,
    NoFeedforward,
    Perceptron,
    RadialBasis,
)
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
