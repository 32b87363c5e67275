"""``python -m cmacexp.video``: see :mod:`cmacexp.commands.video`."""

from cmacexp.commands.video import main

if __name__ == "__main__":
    raise SystemExit(main())
