"""``python -m cmacexp.score``: see :mod:`cmacexp.commands.score`."""

import sys

from cmacexp.commands.score import main

if __name__ == "__main__":
    sys.exit(main())
