"""``python -m cmacexp.verify``: see :mod:`cmacexp.commands.verify`."""

from cmacexp.commands.verify import main

if __name__ == "__main__":
    raise SystemExit(main())
