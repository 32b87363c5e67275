"""Studies of the paper and beyond: their runs, claims, findings, figures and tables."""

import os
import signal
import sys
from pathlib import Path

if sys.argv[:1] == ["-m"]:  # Python has imported this package to find the module named after -m
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # no traceback on Ctrl-C during imports
    name = next((text for text in sys.orig_argv if text.startswith("pipelines.")), "").partition(".")[2]
    files = [Path(__file__).parent / f"{name}{end}" for end in (".md.jinja", ".py", "/__main__.py")]
    if name and (files[0].is_file() or not any(map(Path.is_file, files))):
        index = sys.orig_argv.index(f"pipelines.{name}")
        # A study may not run during this import: a thread that imports a component of this package would deadlock.
        os.execv(sys.executable, [*sys.orig_argv[:index], "pipelines", name, *sys.orig_argv[index + 1 :]])
