"""``python -m cmacexp.score``: see :mod:`cmacexp.commands.score`."""

from cmacexp.commands.score import main

if __name__ == "__main__":
    raise SystemExit(main())
