"""``python -m cmacexp.report``: see :mod:`cmacexp.commands.report`."""

import sys

from cmacexp.commands.report import main

if __name__ == "__main__":
    sys.exit(main())
