"""``python -m cmacexp.warm``: see :mod:`cmacexp.commands.warm`."""

from cmacexp.commands.warm import main

if __name__ == "__main__":
    raise SystemExit(main())
