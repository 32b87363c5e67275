"""What tests of walks use of rooms of the package that is at no door."""

from cmacexp.models.ground import height_at as height_at
from cmacexp.models.ground import stiffness_at as stiffness_at
from cmacexp.planning.columns import JOINT_COLUMNS as JOINT_COLUMNS
from cmacexp.planning.robot import find_centres as find_centres
from cmacexp.plants.environment import make_ground as make_ground
