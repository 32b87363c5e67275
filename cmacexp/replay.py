"""``python -m cmacexp.replay``: see :mod:`cmacexp.commands.replay`."""

from cmacexp.commands.replay import main

if __name__ == "__main__":
    raise SystemExit(main())
