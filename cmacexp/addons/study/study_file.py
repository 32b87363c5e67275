"""Files of a study: its Python file, its page, and the import of the Python file."""

import importlib
import sys
from dataclasses import dataclass
from pathlib import Path

from cmacexp.addons.study.study import Study
from cmacexp.errors import BadComponent, BadInput, CmacexpError, require

STUDY_VARIABLE = "STUDY"
"""Name of the module variable that holds the study."""
TEMPLATE = ".md.jinja"
"""Suffix of the text of a study; ``.md`` works too."""


@dataclass(frozen=True)
class StudyFile:
    """A study and the path of its Python file."""

    path: Path
    study: Study

    @property
    def name(self) -> str:
        """Name of the study: the file name without its suffix."""
        return self.path.stem

    @property
    def page(self) -> Path:
        """Path of the text of the study, Markdown with Jinja, beside the Python file: NAME.md.jinja, else NAME.md."""
        template = self.path.with_suffix(TEMPLATE)
        return template if template.is_file() else self.path.with_suffix(".md")


def find_module(path: Path) -> tuple[Path, str]:
    """Return the folder to import a study from and the module name there.

    The folder is the parent of the package if the file is in one, else the folder of the file.
    """
    if (path.parent / "__init__.py").is_file():
        return path.parent.parent, f"{path.parent.name}.{path.stem}"
    return path.parent, path.stem


def load_study(path: Path) -> StudyFile:
    """Import the study of a file.

    Raises:
        BadInput: the file, its page or the study in it is missing, or another module has the name of the file.
        BadComponent: the import raised an exception, whose traceback the error holds.
    """
    path = path.resolve()
    require(path.is_file(), "study", path, "there is no such file")
    gone = "studies in YAML are gone: write STUDY = cmacexp.study.declare(title=..., runs=[...]) in a file of Python"
    require(path.suffix not in (".yaml", ".yml"), "study", path, gone)
    require(
        path.suffix == ".py" and "." not in path.stem,
        "study",
        path,
        "must be a file of Python, its name without a dot before .py",
    )
    root, name = find_module(path)
    if str(root) not in sys.path:
        sys.path.insert(0, str(root))
    try:
        module = importlib.import_module(name)
    except CmacexpError:
        raise
    except (Exception, SystemExit) as error:
        raise BadComponent("study", path, f"importing it failed: {type(error).__name__}: {error}", error) from error
    is_own = module.__file__ is not None and Path(module.__file__).resolve() == path
    require(is_own, "study", path, f"another module is called {path.stem}; rename this file and its page")
    study = vars(module).get(STUDY_VARIABLE)
    if not isinstance(study, Study):
        raise BadInput("study", path, f"must define {STUDY_VARIABLE} = cmacexp.study.Study(...)")
    file = StudyFile(path, study)
    require(file.page.is_file(), "study", path, f"needs a page of Markdown beside it: {file.page.name}")
    return file
