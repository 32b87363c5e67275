"""``python -m cmacexp scenario=one_leg``."""

import atexit
import os
import sys
import threading

if __name__ == "__main__":
    from cmacexp.garbage import collect_rarely

    collect_rarely()
    from cmacexp.cli import main

    code = main()
    # Without taking apart at the end all objects that importing made, which takes longer than a run.
    threading._shutdown()  # type: ignore[attr-defined]
    atexit._run_exitfuncs()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)
