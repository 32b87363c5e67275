"""Feedforwards: torque that is known from the plan, or learnt from the feedback."""

from cmacexp.feedforward.cmac import CmacFeedforward as CmacFeedforward
from cmacexp.feedforward.cmac import CmacOnModel as CmacOnModel
from cmacexp.feedforward.identified import IdentifiedModel as IdentifiedModel
from cmacexp.feedforward.ilc import IterativeLearning as IterativeLearning
from cmacexp.feedforward.inverse_dynamics import InverseDynamics as InverseDynamics
from cmacexp.feedforward.none import NoFeedforward as NoFeedforward
from cmacexp.feedforward.protocol import Feedforward as Feedforward
from cmacexp.feedforward.protocol import Learns as Learns
from cmacexp.feedforward.protocol import Observes as Observes
from cmacexp.feedforward.protocol import Plays as Plays
from cmacexp.feedforward.rbf import RadialBasis as RadialBasis
