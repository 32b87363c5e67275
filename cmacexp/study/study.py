"""The declaration of a study, and how it is found in its file."""

import importlib
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmacexp.errors import BadInput
from cmacexp.study.requests import Request
from cmacexp.study.results import Measures, Results
from cmacexp.study.statements import Claim, Finding

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

NAME = "STUDY"
"""The variable of a file that holds its study."""


@dataclass(frozen=True, kw_only=True)
class Study:
    """What is run, measured, claimed, found and drawn; the page beside its file says what it means.

    Everything but ``runs`` is a function of the results, and is called when they are complete.
    """

    title: str
    question: str
    """What it asks, in a sentence; not what it answers."""
    runs: Callable[[bool], Sequence[Request]]
    """The runs, given whether it is to be quick."""
    measures: Measures = field(default_factory=dict)
    """Measures of a run besides its metrics: columns of the table of results."""
    computed: "Mapping[str, Callable[[Results], pd.DataFrame]]" = field(default_factory=dict)
    """Tables that are computed besides the runs, and kept beside the page."""
    claims: Mapping[str, Claim] = field(default_factory=dict)
    findings: Mapping[str, Finding] = field(default_factory=dict)
    figures: "Mapping[str, Callable[[Results], Figure]]" = field(default_factory=dict)
    tables: "Mapping[str, Callable[[Results], pd.DataFrame]]" = field(default_factory=dict)
    values: Callable[[Results], Mapping[str, Any]] = lambda results: {}
    """Further values of the page, by name."""


@dataclass(frozen=True)
class StudyFile:
    """A study, and where it stands."""

    path: Path
    study: Study

    @property
    def name(self) -> str:
        """Of its file, without the suffix."""
        return self.path.stem

    @property
    def page(self) -> Path:
        """Its text: Markdown with Jinja."""
        return self.path.with_suffix(".md")


def load_study(path: Path) -> StudyFile:
    """Import the study of a file.

    Raises:
        BadInput: the file, its page or the study in it is missing, or the file cannot be imported by its name.
    """
    path = path.resolve()
    if not path.is_file():
        raise BadInput("study", path, "there is no such file")
    if path.suffix != ".py" or "." in path.stem:
        raise BadInput("study", path, "must be a file of Python, its name without a dot before .py")
    in_package = (path.parent / "__init__.py").is_file()
    root = path.parent.parent if in_package else path.parent
    if str(root) not in sys.path:
        sys.path.insert(0, str(root))
    module = importlib.import_module(f"{path.parent.name}.{path.stem}" if in_package else path.stem)
    if module.__file__ is None or Path(module.__file__).resolve() != path:
        raise BadInput("study", path, f"another module is called {path.stem}; rename this file and its page")
    study = getattr(module, NAME, None)
    if not isinstance(study, Study):
        raise BadInput("study", path, f"must define {NAME} = cmacexp.study.Study(...)")
    found = StudyFile(path, study)
    if not found.page.is_file():
        raise BadInput("study", path, f"needs a page of Markdown beside it: {found.page.name}")
    return found
