"""Studies of the paper and beyond: what each runs, what it claims, what it draws."""

import sys
from importlib import import_module
from pathlib import Path

if sys.argv[:1] == ["-m"]:  # Python is about to look for the module that was typed
    name = next((text for text in sys.orig_argv if text.startswith("pipelines.")), "").partition(".")[2]
    own = [Path(__file__).parent / f"{name}{end}" for end in (".md", ".py", "/__main__.py")]
    if name and (own[0].is_file() or not any(map(Path.is_file, own))):
        sys.argv = ["pipelines", name, *sys.argv[1:]]
        sys.exit(import_module("pipelines.__main__").main())  # unseen by who follows the imports of a component
