"""What tests of learning need of other rooms and find at no door yet."""

from cmacexp.cmac.memory import read as read
from cmacexp.cmac.memory import train as train
from cmacexp.cmac.rules import RULES as RULES
from cmacexp.cmac.rules import train_by_rule as train_by_rule
from cmacexp.data.integrity import is_finished as is_finished
from cmacexp.jit.compiler import expect_steps as expect_steps
from cmacexp.models.leg import Leg as Leg
from cmacexp.models.leg import jacobian as jacobian
from cmacexp.models.leg import trigonometry as trigonometry
from cmacexp.plants.kernels import new_state as new_state
from cmacexp.plants.protocol import new_measurement as new_measurement
from cmacexp.sensors.kernels import new_observation as new_observation
