"""Plants: machines on their ground."""

from cmacexp.plants.analytic import AnalyticPlant
from cmacexp.plants.protocol import Measurement, Plant
from cmacexp.plants.robot_signals import RobotSignals

__all__ = ["AnalyticPlant", "Measurement", "Plant", "RobotSignals"]
