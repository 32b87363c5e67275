"""Equations of legs, of the room ``models``, that tests of other rooms compute with."""

from cmacexp.models.leg import forward_dynamics as forward_dynamics
from cmacexp.models.leg import trigonometry as trigonometry
from cmacexp.models.mechanism import get_leg as get_leg
