"""Cerebellar model articulation controller (CMAC): quantiser, displacement, addressing, memory."""

from cmacexp.cmac.network import Cmac

__all__ = ["Cmac"]
