"""Hybrid position/force feedback."""

from cmacexp.control.controllers import DriveController, HybridController
from cmacexp.control.protocol import Action, Controller, Drive
from cmacexp.planning.plan import Reference

__all__ = ["Action", "Controller", "Drive", "DriveController", "HybridController", "Reference"]
