"""``python -m cmacexp.gap``: see :mod:`cmacexp.commands.gap`."""

from cmacexp.commands.gap import main

if __name__ == "__main__":
    raise SystemExit(main())
