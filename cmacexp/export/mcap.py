"""The old place of a function that programs may rely on."""

from cmacexp.export.tables import write_mcap as write_mcap
