"""``python -m cmacexp.study FILE.py``: see :mod:`cmacexp.commands.study`."""

from cmacexp.commands.study import main

if __name__ == "__main__":
    main()
