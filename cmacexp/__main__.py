"""``python -m cmacexp scenario=one_leg``."""

import sys

if __name__ == "__main__":
    if {"-m", "--multirun"} & set(sys.argv):
        from cmacexp.experiment.forking import make_context

        make_context()  # what workers need is imported while this process imports what it needs
    from cmacexp.commands.main import main

    sys.exit(main())
