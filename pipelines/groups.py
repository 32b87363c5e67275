"""Groups of studies, each with one page over all of them: ``python -m pipelines.paper``, ``.learning`` and so on.

``outputs/studies/NAME/report.html`` of a group is a table of what the paper says beside what was measured, if its
studies have claims, then the sections of each study. The benchmark has a command of its own.
"""

from pathlib import Path
from typing import NamedTuple, NoReturn

from cmacexp.addons.study.command import FOLDER_KEY, Options, print_statements, run_studies, write_studies
from cmacexp.addons.study.page import write_page
from cmacexp.addons.study.study_file import StudyFile, load_study
from cmacexp.data.folder import new_result
from cmacexp.data.manifest import REPORT
from pipelines.benchmark import benchmark, log_track
from pipelines.benchmark.entrants import MACHINES, list_methods

PIPELINES = Path(__file__).resolve().parent


class Group(NamedTuple):
    """Studies that answer one question together."""

    title: str
    question: str
    studies: tuple[str, ...]
    """Names, in the order of the page."""


GROUPS = {
    "paper": Group(
        "Lin & Song 1997, claim by claim",
        "Learning Hybrid Position/Force Control of a Quadruped Walking Machine Using a CMAC Neural Network, "
        "repeated: which of its claims do new runs reproduce?",
        ("lead_design", "force_methods", "one_leg_learning", "quadruped_walking", "cmac_size", "assumptions"),
    ),
    "learning": Group(
        "Learning that lasts",
        "Which learners, rules, rates, leads and memories learn fast and for long, also with delayed sensors?",
        ("feedforwards", "long_learning", "late_learning", "hashing", "sensors"),
    ),
    "quadrupeds": Group(
        "Robots of today",
        "What does learned feedforward gain on today's quadrupeds, in moving gaits and with delayed feedback?",
        ("robots", "moving_robots", "identified_robot", "speed_change", "late_robots", "drives", "drives_harder"),
    ),
    "bounded": Group(
        "Guarded learning",
        "Which configurations stay bounded, and does the guard keep the others from harm?",
        ("guard", "when_learning_holds"),
    ),
}  # fmt: skip


def find_study(name: str) -> Path | None:
    """The file of a study of this folder; None if there is no such study."""
    path = PIPELINES / f"{name}.py"
    return path if path.is_file() and path.with_suffix(".md").is_file() else None


def all_studies() -> list[StudyFile]:
    """Every study of this folder, by name."""
    return [load_study(path) for page in sorted(PIPELINES.glob("*.md")) if (path := find_study(page.stem))]


def every_study() -> list[StudyFile]:
    """All studies; then the benchmark, of all machines and methods, and its log track."""
    whole = benchmark.make_study(MACHINES, [method.name for method in list_methods()])
    return [*all_studies(), StudyFile(PIPELINES / "benchmark" / "benchmark.py", whole), log_track.make_study()]


def write(name: str, options: Options) -> Path:
    """Make what is missing or stale of the studies of a group, and write one page over them; returns it."""
    title, question, members = GROUPS[name]
    studies = write_studies([load_study(path) for each in members if (path := find_study(each))], options)
    print_statements(studies)
    with new_result(options.choose_folder(name), FOLDER_KEY, REPORT) as place:
        return write_page(title, question, studies, place, options.quick)


def run_group(name: str) -> NoReturn:
    """Run the command of a group."""
    run_studies(f"pipelines.{name}", GROUPS[name].question, lambda _, options: write(name, options))
