"""Hybrid position/force feedback."""

from cmacexp.control.hybrid import HybridController
from cmacexp.control.protocol import Action, Controller
from cmacexp.planning.setup import Reference

__all__ = ["Action", "Controller", "HybridController", "Reference"]
