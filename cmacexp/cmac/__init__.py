"""The cerebellar model articulation controller: quantiser, displacement, addressing, memory."""

from cmacexp.cmac.network import Cmac

__all__ = ["Cmac"]
