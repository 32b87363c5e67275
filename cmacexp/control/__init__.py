"""Hybrid position/force feedback."""

from cmacexp.control.drives import DriveController
from cmacexp.control.hybrid import HybridController
from cmacexp.control.protocol import Action, Controller, Drive
from cmacexp.planning.setup import Reference

__all__ = ["Action", "Controller", "Drive", "DriveController", "HybridController", "Reference"]
