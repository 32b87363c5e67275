"""``python -m cmacexp.export``: see :mod:`cmacexp.commands.export`."""

import sys

from cmacexp.commands.export import main

if __name__ == "__main__":
    sys.exit(main())
