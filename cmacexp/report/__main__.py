"""``python -m cmacexp.report``: see :mod:`cmacexp.commands.report`."""

from cmacexp.commands.report import main

if __name__ == "__main__":
    raise SystemExit(main())
