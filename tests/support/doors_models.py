"""Equations of legs and robots, of the room ``models``, that tests of other rooms compute with."""

from cmacexp.models.lateness import Lateness as Lateness
from cmacexp.models.lead import discretise as discretise
from cmacexp.models.leg import forward_dynamics as forward_dynamics
from cmacexp.models.leg import trigonometry as trigonometry
from cmacexp.models.mechanism import get_leg as get_leg
from cmacexp.models.robot_gains import derive_basis as derive_basis
from cmacexp.models.robot_gains import derive_gains as derive_gains
from cmacexp.models.robot_gains import recommend_period as recommend_period
