"""``python -m cmacexp.gap``: see :mod:`cmacexp.commands.gap`."""

import sys

from cmacexp.commands.gap import main

if __name__ == "__main__":
    sys.exit(main())
