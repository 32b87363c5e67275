"""``python -m cmacexp.export``: see :mod:`cmacexp.commands.export`."""

from cmacexp.commands.export import main

if __name__ == "__main__":
    raise SystemExit(main())
