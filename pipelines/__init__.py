"""Studies of the paper and beyond: what each runs, what it claims, what it draws."""

import sys
from importlib import import_module
from pathlib import Path

if sys.argv[:1] == ["-m"]:  # Python is about to look for the module that was typed
    name = next((text for text in sys.orig_argv if text.startswith("pipelines.")), "").partition(".")[2]
    if name and not any((Path(__file__).parent / f"{name}{end}").is_file() for end in (".py", "/__main__.py")):
        sys.argv = ["pipelines", name, *sys.argv[1:]]
        sys.exit(import_module("pipelines.__main__").main())  # unseen by who follows the imports of a component
