"""``python -m cmacexp scenario=one_leg``."""

import atexit
import gc
import os
import sys
import threading

if __name__ == "__main__":
    # Importing makes a hundred thousand objects that stay: looking for garbage among them takes longer than a run.
    gc.set_threshold(100_000, 50, 50)
    from cmacexp.cli.main import main

    code = main()
    # Without taking apart at the end all objects that importing made, which takes longer than a run.
    threading._shutdown()  # type: ignore[attr-defined]
    atexit._run_exitfuncs()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)
