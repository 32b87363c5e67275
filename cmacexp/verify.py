"""``python -m cmacexp.verify``: see :mod:`cmacexp.commands.verify`."""

import sys

from cmacexp.commands.verify import main

if __name__ == "__main__":
    sys.exit(main())
