"""``python -m cmacexp.warm``: see :mod:`cmacexp.commands.warm`."""

import sys

from cmacexp.commands.warm import main

if __name__ == "__main__":
    sys.exit(main())
