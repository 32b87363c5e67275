"""Plants: machines on their ground."""

from cmacexp.plants.analytic import AnalyticPlant
from cmacexp.protocols import Measurement, Plant, RobotSignals

__all__ = ["AnalyticPlant", "Measurement", "Plant", "RobotSignals"]
