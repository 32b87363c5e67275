"""``python -m cmacexp.robots``: see :mod:`cmacexp.commands.robots`."""

import sys

from cmacexp.commands.robots import main

if __name__ == "__main__":
    sys.exit(main())
