"""What lies between the plant and the controller's knowledge of it."""

from cmacexp.sensors.protocol import PerfectSensors, Sensors
from cmacexp.sensors.real import RealSensors

__all__ = ["PerfectSensors", "RealSensors", "Sensors"]
