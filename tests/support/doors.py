"""The doors of the project that tests of any room use: the only place that says in which module each one stands.

A test imports inner modules of its own room alone, so that a change inside a room changes no test elsewhere
(``tests/laws/test_house.py``). What it needs of other rooms it takes from ``cmacexp``, from the packages of the rooms
(``cmacexp.planning``), and from here.
"""

from cmacexp.cmac.memory import read as read
from cmacexp.cmac.memory import train as train
from cmacexp.cmac.rules import RULES as RULES
from cmacexp.cmac.rules import train_by_rule as train_by_rule
from cmacexp.commands.study import Options as Options
from cmacexp.commands.study import write_studies as write_studies
from cmacexp.config.compose import compose_config as compose_config
from cmacexp.config.compose import compose_untyped as compose_untyped
from cmacexp.config.machine import RobotMachine as RobotMachine
from cmacexp.data.integrity import faults as faults
from cmacexp.data.integrity import is_finished as is_finished
from cmacexp.data.trace import Trace as Trace
from cmacexp.engine.run import run_scenario as run_scenario
from cmacexp.engine.without_effect import list_idle_overrides as list_idle_overrides
from cmacexp.errors import BadComponent as BadComponent
from cmacexp.errors import BadInput as BadInput
from cmacexp.errors import BadRun as BadRun
from cmacexp.errors import CmacexpError as CmacexpError
from cmacexp.errors import Diverged as Diverged
from cmacexp.feedforward.ilc import gaussian_taps as gaussian_taps
from cmacexp.jit.compiler import program as program
from cmacexp.jit.compiler import workload as workload
from cmacexp.jit.hooks import Hook as Hook
from cmacexp.jit.sources import KERNEL_ROOMS as KERNEL_ROOMS
from cmacexp.jit.sources import RESULT_ROOMS as RESULT_ROOMS
from cmacexp.loop.scenario import make_scenario as make_scenario
from cmacexp.metrics.run_table import make_rows as make_rows
from cmacexp.models.body import Load as Load
from cmacexp.models.body import depth as depth
from cmacexp.models.body import make_pose as make_pose
from cmacexp.models.ground import height_at as height_at
from cmacexp.models.ground import stiffness_at as stiffness_at
from cmacexp.models.lead import discretise as discretise
from cmacexp.models.leg import Leg as Leg
from cmacexp.models.leg import foot_position as foot_position
from cmacexp.models.leg import foot_velocity as foot_velocity
from cmacexp.models.leg import forward_dynamics as forward_dynamics
from cmacexp.models.leg import inverse_dynamics as inverse_dynamics
from cmacexp.models.leg import jacobian as jacobian
from cmacexp.models.leg import joint_torque as joint_torque
from cmacexp.models.leg import trigonometry as trigonometry
from cmacexp.models.loop_delay import LoopDelay as LoopDelay
from cmacexp.models.mechanism import get_leg as get_leg
from cmacexp.models.mechanism import legs_on_stand as legs_on_stand
from cmacexp.models.mechanism import legs_under_body as legs_under_body
from cmacexp.models.robot_file import package_models as package_models
from cmacexp.models.robot_gains import derive_basis as derive_basis
from cmacexp.models.robot_gains import derive_gains as derive_gains
from cmacexp.models.robot_gains import recommend_period as recommend_period
from cmacexp.planning.columns import JOINT_COLUMNS as JOINT_COLUMNS
from cmacexp.planning.machine import make_mechanism as make_mechanism
from cmacexp.planning.robot import find_centres as find_centres
from cmacexp.plants.environment import make_ground as make_ground
from cmacexp.plants.kernels import new_state as new_state
from cmacexp.plants.protocol import new_measurement as new_measurement
from cmacexp.report.page import Report as Report
from cmacexp.report.page import write_report as write_report
from cmacexp.sensors.kernels import new_observation as new_observation
from cmacexp.study.interval import UNPAIRED as UNPAIRED
from cmacexp.study.interval import estimate as estimate
from cmacexp.study.results import RunRow as RunRow
from cmacexp.study.study_file import load_study as load_study
