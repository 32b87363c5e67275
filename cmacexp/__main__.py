"""``python -m cmacexp scenario=one_leg``."""

import gc
import sys

if __name__ == "__main__":
    from cmacexp.cli.main import main

    code = main()
    gc.freeze()  # else Python looks for garbage among all that was imported, which takes a fifth of a run's time
    sys.exit(code)
