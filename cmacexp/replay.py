"""``python -m cmacexp.replay``: see :mod:`cmacexp.commands.replay`."""

import sys

from cmacexp.commands.replay import main

if __name__ == "__main__":
    sys.exit(main())
