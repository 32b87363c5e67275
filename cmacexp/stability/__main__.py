"""``python -m cmacexp.stability``: see :mod:`cmacexp.commands.stability`."""

import sys

from cmacexp.commands.stability import main

if __name__ == "__main__":
    sys.exit(main())
