"""The doors of the project that tests of any room use: the only place that says in which module each one stands.

A test imports inner modules of its own room alone, so that a change inside a room changes no test elsewhere
(``tests/laws/test_house.py``). What it needs of other rooms it takes from ``cmacexp``, from the packages of the rooms
(``cmacexp.planning``), and from here.
"""

from cmacexp.config.compose import compose_config as compose_config
from cmacexp.errors import BadInput as BadInput
from cmacexp.errors import BadRun as BadRun
from cmacexp.errors import CmacexpError as CmacexpError
from cmacexp.experiment.run import run_scenario as run_scenario
from cmacexp.loop.scenario import make_scenario as make_scenario
from cmacexp.models.mechanism import Mechanism as Mechanism
from cmacexp.planning.machine import make_mechanism as make_mechanism
from cmacexp.report.page import Report as Report
from cmacexp.report.page import write_report as write_report
