"""``python -m cmacexp.stability``: see :mod:`cmacexp.commands.stability`."""

from cmacexp.commands.stability import main

if __name__ == "__main__":
    raise SystemExit(main())
