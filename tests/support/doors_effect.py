"""What a command line does before a run, for tests of other rooms than ``config``, ``cmac`` and ``experiment``."""

from cmacexp.cmac.rules import RULES as RULES
from cmacexp.config.compose import compose_untyped as compose_untyped
from cmacexp.experiment.without_effect import warnings_of as warnings_of
