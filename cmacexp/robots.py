"""``python -m cmacexp.robots``: see :mod:`cmacexp.commands.robots`."""

from cmacexp.commands.robots import main

if __name__ == "__main__":
    raise SystemExit(main())
