"""Hybrid position/force feedback."""

from cmacexp.control.controllers import DriveController, HybridController
from cmacexp.planning.plan import Reference
from cmacexp.protocols import Action, Controller, Drive

__all__ = ["Action", "Controller", "Drive", "DriveController", "HybridController", "Reference"]
