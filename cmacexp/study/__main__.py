"""``python -m cmacexp.study FILE.py``: see :mod:`cmacexp.cli.study`."""

from cmacexp.cli.study import main

if __name__ == "__main__":
    main()
