"""``python -m cmacexp.video``: see :mod:`cmacexp.commands.video`."""

import sys

from cmacexp.commands.video import main

if __name__ == "__main__":
    sys.exit(main())
