"""Studies of the paper and beyond: what each runs, what it claims, what it draws."""

import os
import signal
import sys
from pathlib import Path

if sys.argv[:1] == ["-m"]:  # Python is about to look for the module that was typed
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C while modules are imported prints no traceback
    name = next((text for text in sys.orig_argv if text.startswith("pipelines.")), "").partition(".")[2]
    own = [Path(__file__).parent / f"{name}{end}" for end in (".md", ".py", "/__main__.py")]
    if name and (own[0].is_file() or not any(map(Path.is_file, own))):
        place = sys.orig_argv.index(f"pipelines.{name}")
        # Nothing may run in here: a thread that imports a component of this package would wait for ever.
        os.execv(sys.executable, [*sys.orig_argv[:place], "pipelines", name, *sys.orig_argv[place + 1 :]])
