"""What tests of the studies use of rooms of the package that is at no door."""

from cmacexp.commands.study import Options as Options
from cmacexp.commands.study import write_studies as write_studies
from cmacexp.data.integrity import faults as faults
from cmacexp.feedforward.ilc import gaussian_taps as gaussian_taps
from cmacexp.models.leg import Leg as Leg
from cmacexp.models.leg import inverse_dynamics as inverse_dynamics
from cmacexp.models.leg import trigonometry as trigonometry
from cmacexp.models.robot_file import package_models as package_models
from cmacexp.report.run_summary import RunSummary as RunSummary
from cmacexp.report.run_summary import read_summary as read_summary
from cmacexp.study.interval import UNPAIRED as UNPAIRED
from cmacexp.study.interval import estimate as estimate
from cmacexp.study.results import Row as Row
from cmacexp.study.study import load_study as load_study
