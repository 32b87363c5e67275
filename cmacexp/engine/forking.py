"""How worker processes start: as copies of one that has imported what they need."""

import multiprocessing
import signal
from multiprocessing import forkserver
from typing import Any

PRELOADED = ["cmacexp.engine.sweep_job", "cmacexp.engine.run", "cmacexp.terminal.tables"]
PRELOADED += ["cmacexp.jit.numba_private", "cmacexp.config.compose", "hydra.core.override_parser.overrides_parser"]
"""Modules that workers need."""


def make_context() -> Any:
    """What starts processes, the first one at once."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(PRELOADED)
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)  # which it inherits: Ctrl-C reaches it too
    try:
        forkserver.ensure_running()
    finally:
        signal.signal(signal.SIGINT, before)
    return context
