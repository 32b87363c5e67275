"""``python -m cmacexp.export``: runs the command ``export``, which is an add-on."""

from cmacexp.__main__ import run_named

if __name__ == "__main__":
    raise SystemExit(run_named("export"))
