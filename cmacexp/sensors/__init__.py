"""Sensors between plant and controller: perfect, or noisy, delayed and faulty."""

from cmacexp.sensors.proprioceptive import ProprioceptiveSensors
from cmacexp.sensors.protocol import PerfectSensors, Sensors
from cmacexp.sensors.real import RealSensors

__all__ = ["PerfectSensors", "ProprioceptiveSensors", "RealSensors", "Sensors"]
