"""Sensors between plant and controller: perfect, or noisy, delayed and faulty."""

from cmacexp.protocols import Sensors
from cmacexp.sensors.perfect import PerfectSensors
from cmacexp.sensors.proprioceptive import ProprioceptiveSensors
from cmacexp.sensors.real import RealSensors

__all__ = ["PerfectSensors", "ProprioceptiveSensors", "RealSensors", "Sensors"]
