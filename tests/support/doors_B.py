"""Names of rooms that stand at no door yet and that tests of other rooms need."""

from cmacexp.errors import BadComponent as BadComponent
from cmacexp.errors import Diverged as Diverged
from cmacexp.models.body import Load as Load
from cmacexp.models.body import depth as depth
from cmacexp.models.body import make_pose as make_pose
from cmacexp.models.ground import stiffness_at as stiffness_at
from cmacexp.models.leg import Leg as Leg
from cmacexp.models.leg import foot_position as foot_position
from cmacexp.models.leg import foot_velocity as foot_velocity
from cmacexp.models.leg import forward_dynamics as forward_dynamics
from cmacexp.models.leg import joint_torque as joint_torque
from cmacexp.models.leg import trigonometry as trigonometry
from cmacexp.models.mechanism import get_leg as get_leg
from cmacexp.models.mechanism import legs_on_stand as legs_on_stand
from cmacexp.models.mechanism import legs_under_body as legs_under_body
from cmacexp.models.mechanism import point_mass as point_mass
from cmacexp.plants.protocol import new_measurement as new_measurement
