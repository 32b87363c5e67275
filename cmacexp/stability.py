"""``python -m cmacexp.stability``: runs the command ``stability``, which is an add-on."""

from cmacexp.__main__ import run_named

if __name__ == "__main__":
    raise SystemExit(run_named("stability"))
