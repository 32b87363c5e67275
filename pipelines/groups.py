"""Groups of studies with one common page: ``python -m pipelines.paper``, ``.learning`` and so on.

``outputs/studies/NAME/report.html`` of a group starts with a table of the paper's claims and their measured values,
if its studies have claims; the sections of each study follow. The benchmark has its own command.
"""

from pathlib import Path
from typing import NamedTuple, NoReturn

from cmacexp.addons.study.command import FOLDER_KEY, Options, print_statements, run_studies, write_studies
from cmacexp.addons.study.page import write_page
from cmacexp.addons.study.study_file import TEMPLATE, StudyFile, load_study
from cmacexp.data.folder import new_result
from cmacexp.data.manifest import REPORT
from pipelines.benchmark import benchmark, log_track
from pipelines.benchmark.entrants import MACHINES, list_methods

PIPELINES = Path(__file__).resolve().parent


class Group(NamedTuple):
    """A group of studies that together answer one question."""

    title: str
    question: str
    studies: tuple[str, ...]
    """Names of the studies, in the order of the page."""


GROUPS = {
    "paper": Group(
        "Lin & Song 1997, claim by claim",
        "Learning Hybrid Position/Force Control of a Quadruped Walking Machine Using a CMAC Neural Network, "
        "repeated: which of its claims do new runs reproduce?",
        ("paper_settings", "lead_design", "force_methods", "one_leg_learning", "quadruped_walking", "cmac_size"),
    ),
    "learning": Group(
        "Learning that lasts",
        "Which learners, rules, rates, leads and memories learn fast and for long, also with delayed sensors?",
        ("feedforwards", "long_learning", "late_learning", "hashing", "sensors"),
    ),
    "quadrupeds": Group(
        "Robots of today",
        "What does learned feedforward gain on today's quadrupeds, in moving gaits and with delayed feedback?",
        ("robots", "moving_robots", "identified_robot", "go2_feedforwards", "speed_change", "late_robots", "drives",
         "drives_harder"),
    ),
    "bounded": Group(
        "Guarded learning",
        "Which configurations stay bounded, and does the guard keep the others from harm?",
        ("guard", "when_learning_holds"),
    ),
}  # fmt: skip


def find_study(name: str) -> Path | None:
    """Return the file of the study ``name`` in this folder; None if there is none."""
    path = PIPELINES / f"{name}.py"
    return path if path.is_file() and path.with_suffix(TEMPLATE).is_file() else None


def all_studies() -> list[StudyFile]:
    """Load every study of this folder, sorted by name."""
    return [load_study(path) for file in sorted(PIPELINES.glob("*.py")) if (path := find_study(file.stem))]


def every_study() -> list[StudyFile]:
    """Load all studies, then the benchmark with all machines and methods, then its log track."""
    whole = benchmark.make_study(MACHINES, [method.name for method in list_methods()])
    return [*all_studies(), StudyFile(PIPELINES / "benchmark" / "benchmark.py", whole), log_track.make_study()]


def write(name: str, options: Options) -> Path:
    """Compute missing or outdated results of the studies of a group, write their common page, and return its path."""
    title, question, members = GROUPS[name]
    studies = write_studies([load_study(path) for member in members if (path := find_study(member))], options)
    print_statements(studies)
    with new_result(options.choose_folder(name), FOLDER_KEY, REPORT) as folder:
        return write_page(title, question, studies, folder, options.quick)


def run_group(name: str) -> NoReturn:
    """Run the command of the group ``name``, and exit."""
    run_studies(f"pipelines.{name}", GROUPS[name].question, lambda _, options: write(name, options))
