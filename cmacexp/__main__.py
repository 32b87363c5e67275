"""``python -m cmacexp scenario=one_leg``."""

import gc
import sys

if __name__ == "__main__":
    gc.set_threshold(200_000)  # looking for garbage among all that is imported finds none, and takes 4 % of a run
    from cmacexp.commands.main import main

    code = main()
    gc.freeze()  # else Python looks for garbage among all that was imported, which takes a fifth of a run's time
    sys.exit(code)
