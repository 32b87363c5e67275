"""The doors of the project that tests of any room use: the only place that says in which module each one stands.

A test imports inner modules of its own room alone, so that a change inside a room changes no test elsewhere
(``tests/laws/test_house.py``). What it needs of other rooms it takes from ``cmacexp``, from the packages of the rooms
(``cmacexp.planning``), and from here; so also ``roll_out``, which runs what ``make_scenario`` makes.
"""

from support.rollout import roll_out

from cmacexp.addons.gap.analysis import Gap
from cmacexp.addons.gap.reading import read_log
from cmacexp.addons.study.command import Options, write_studies
from cmacexp.addons.study.interval import UNPAIRED, estimate
from cmacexp.addons.study.results import RunRow
from cmacexp.addons.study.study_file import load_study
from cmacexp.addons.video.meshes import read_shown_model
from cmacexp.cmac.memory import read, train
from cmacexp.cmac.rules import RULES, train_by_rule
from cmacexp.config.compose import compose_config, compose_untyped
from cmacexp.config.machine import RobotMachine
from cmacexp.data.files import sha256
from cmacexp.data.folder import collection, remove_dead_parts
from cmacexp.data.integrity import faults, is_finished
from cmacexp.data.records import RunEnd
from cmacexp.data.tables import read_table
from cmacexp.data.trace import Trace
from cmacexp.engine.run import run_scenario
from cmacexp.engine.without_effect import list_idle_overrides
from cmacexp.errors import BadComponent, BadInput, BadRun, CmacexpError, Diverged, SmallMargin
from cmacexp.feedforward.ilc import gaussian_taps
from cmacexp.jit.compiler import program, workload
from cmacexp.jit.hooks import Hook
from cmacexp.jit.interrupt import interrupt_held_back
from cmacexp.jit.sources import KERNEL_ROOMS, RESULT_ROOMS
from cmacexp.loop import step
from cmacexp.loop.scenario import make_scenario
from cmacexp.models.body import Load, depth, make_pose
from cmacexp.models.ground import height_at, stiffness_at
from cmacexp.models.lead import discretise
from cmacexp.models.leg import (
    Leg,
    foot_position,
    foot_velocity,
    forward_dynamics,
    inverse_dynamics,
    jacobian,
    joint_torque,
    trigonometry,
)
from cmacexp.models.loop_delay import LoopDelay
from cmacexp.models.mechanism import get_leg, legs_on_stand, legs_under_body
from cmacexp.models.robot_file import package_models
from cmacexp.models.robot_gains import derive_basis, derive_gains, recommend_period
from cmacexp.models.trend import TREND_WINDOW
from cmacexp.planning.machine import find_centres, make_mechanism
from cmacexp.plants.as_built import make_ground
from cmacexp.plants.kernels import new_state
from cmacexp.protocols import new_measurement
from cmacexp.report.page import Report, write_report
from cmacexp.sensors.kernels import new_observation
