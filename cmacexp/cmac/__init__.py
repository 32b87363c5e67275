"""The cerebellar model articulation controller: quantiser, displacement, addressing, memory."""

from cmacexp.cmac.network import Cmac
from cmacexp.cmac.regressor import CmacRegressor

__all__ = ["Cmac", "CmacRegressor"]
