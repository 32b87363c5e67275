"""Learned feedforward (CMAC) for hybrid position/force control of legs: Lin & Song 1997 and beyond."""

__version__ = "0.1.0"
