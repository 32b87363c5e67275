"""Names of rooms without a door, which tests of other rooms need."""

from cmacexp.report.page import Report as Report
from cmacexp.report.page import write_report as write_report
