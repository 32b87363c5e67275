"""Public names of :mod:`cmacexp.addons.study` for studies; and ``python -m cmacexp.study``."""

from cmacexp.addons.study import *  # noqa: F403
from cmacexp.addons.study import __all__ as __all__

if __name__ == "__main__":
    from cmacexp.__main__ import run_named

    raise SystemExit(run_named("study"))
