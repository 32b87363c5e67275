"""``python -m cmacexp scenario=one_leg``."""

import sys

from cmacexp.commands.main import main

if __name__ == "__main__":
    sys.exit(main())
