"""What users see: some answers word for word (``messages.txt``), and one rule for all (``wrong_inputs.txt``).

A line of ``messages.txt`` that starts with ``$`` is a whole command, or config overrides that are run; one that
starts with ``>>>`` is Python. Renew all answers with ``PYTHONPATH=.:tests python tests/commands/test_messages.py``,
then read the diff. ``wrong_inputs.txt`` has no answers: what is typed there is refused, and the answer says why.
"""

import contextlib
import re
import shlex
import shutil
import sys
import tempfile
from pathlib import Path

import pytest
from support.command import call
from support.controllers import CONTROLLERS
from support.doors import CmacexpError, compose_config, make_scenario
from support.robots import OWN

import cmacexp

PAGE = Path(__file__).with_name("messages.txt")
BLOCKS = re.split(r"\n\n(?=\$ |>>> |# )", PAGE.read_text().rstrip("\n"))
"""A comment, or a line and its answer."""
RUN = ["scenario=one_leg", "cycles=2"]
RUNS = {
    "run": ["record=trace"],
    "thinned": ["record=trace", "record.cycles=[1]"],
    "metrics_alone": ["record=metrics"],
    "spoiled": ["record.weights=true"],
}
FILES = {
    "my_components.py": CONTROLLERS,
    "my_mistake.py": "import no_such_module\n",
    "my_syntax.py": "def f(:\n",
    "my_exit.py": "raise SystemExit(0)\n",
    "robot.xml": OWN.read_text(),
    "tables/sweep.csv": "a,b\n1,2\n",
    "empty/.keep": "",
}
ALLOWED = re.compile(
    r"\b(must|choose|no such|not allowed with|did you mean|takes?|use|add|name the|give|write|run it)\b"
    r"|leave out|which has"
)
"""What says of a wrong value what a right one is, or what to do."""
FOUND = re.compile("importing .* failed: |cannot be (made|read)|is not a plant|was killed")
"""What says of a file or a class what is wrong with it."""


def make_folder(folder: Path) -> None:
    """Custom components, runs, and what can be wrong with them."""
    for name, text in FILES.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text)
    for name, more in RUNS.items():
        cmacexp.run([*RUN, *more], folder / name)
    (folder / "spoiled" / "weights.npz").write_bytes(b"other")
    runs = folder / "runs"
    for name in ("killed", "changed", "edited", "incomplete", "shapeless", "unreadable"):
        shutil.copytree(folder / "run", runs / name)
    (runs / "killed" / "manifest.json").unlink()
    (runs / "incomplete" / "metrics.parquet").unlink()
    (runs / "unreadable" / "manifest.json").write_text("{")
    (runs / "shapeless" / "manifest.json").write_text('{"status": "completed", "config": [], "files": {}}')
    (runs / "changed" / "trace.parquet").write_bytes((folder / "thinned" / "trace.parquet").read_bytes())
    edited = runs / "edited" / "manifest.json"
    edited.write_text(edited.read_text().replace('"mass_1": 0.5', '"mass_1": 0.6'))


def answer(line: str) -> str:
    """What is answered to a line of the page; the current folder, and long lists of names, have words instead."""
    words = shlex.split(line)
    try:
        if words[0] == ">>>":
            found = eval(line[4:], {"run": cmacexp.run})
        elif words[1] == "python":
            done = call(words[3].partition(".")[2] or "main", *words[4:])
            found = f"{done.stdout}{done.stderr}exit code {done.returncode}"
        else:
            with tempfile.TemporaryDirectory() as folder:
                run = cmacexp.run(words[1:], Path(folder) / "run")
                found = f"{run.status} {run.manifest['cause']}"
    except CmacexpError as error:
        found = f"error: {error}"
    found = re.sub(r"(\w+, ){8,}", "MANY, ", found.replace(str(Path.cwd()), "FOLDER"))
    return "\n".join(part.rstrip() for part in found.splitlines()).strip()


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    found = tmp_path_factory.mktemp("messages")
    make_folder(found)
    return found


@pytest.fixture
def folder(made, monkeypatch):
    """The current folder, with what the lines name."""
    monkeypatch.chdir(made)
    monkeypatch.syspath_prepend(str(made))
    return made


NEEDS = re.compile("python -m|mujoco|machine=|quadruped posture")
"""What takes MuJoCo, or long."""
PINNED = [
    pytest.param(block, id=block.splitlines()[0][:80], marks=[pytest.mark.ci] if NEEDS.search(block) else [])
    for block in BLOCKS
    if block[0] != "#"
]


@pytest.mark.parametrize("block", PINNED)
def test_an_answer_is_word_for_word_that_of_the_page(block, folder):
    line, _, expected = block.partition("\n")
    assert answer(line) == expected, f"if this is meant, renew the page: python {Path(__file__).name}"


def check_message(line: str, said: str) -> None:
    """Hold a message to the rule: one short line that names what was typed, and what would be right or was found."""
    assert re.fullmatch(r"error: [^\n]{1,590}\n?", said), f"{line}\n{said}"
    words = shlex.split(line)
    words = words[3:] if words[0] == "python" else words
    named = re.match(r"error: (?:#\d+: )?([-\w./]+)", said)
    typed = {re.split(r"[=.]", word.lstrip("+~"))[0] for word in words}
    assert named[1].split(".")[0] in typed or any(word in said for word in words), f"{line}\n{said}"
    assert ALLOWED.search(said) or FOUND.search(said), f"{line}\n{said}"


def sections() -> dict[str, list[str]]:
    """What is typed, by what is wrong with it."""
    parts = re.split(r"^# (.*)\n", PAGE.with_name("wrong_inputs.txt").read_text(), flags=re.MULTILINE)[1:]
    return {name: text.strip().split("\n") for name, text in zip(parts[::2], parts[1::2], strict=True)}


TYPED = sections()
SLOW = ("Robots and MuJoCo", "Commands")
PARTS = [lines[i::10] for name, lines in TYPED.items() if name not in SLOW for i in range(min(10, len(lines)))]
"""So small that each takes a fraction of a second."""


@pytest.mark.parametrize("lines", [*PARTS, pytest.param(TYPED[SLOW[0]], marks=pytest.mark.ci)])
def test_a_wrong_config_is_refused_in_one_line_that_says_what_is_right(lines, folder):
    for line in lines:
        with pytest.raises(CmacexpError) as caught:
            make_scenario(compose_config(shlex.split(line)))
        check_message(line, f"error: {caught.value}")


@pytest.mark.ci
def test_a_wrong_command_ends_with_2_before_anything_is_simulated(folder):

    def find_results():
        return {
            path: path.read_bytes() for path in folder.rglob("*.*") if path.suffix in (".json", ".parquet", ".csv")
        }

    before = find_results()
    for line in TYPED["Commands"]:
        words = shlex.split(line)
        done = call(words[2].removeprefix("cmacexp").removeprefix(".") or "main", *words[3:])
        assert (done.returncode, done.stdout) == (2, ""), line
        check_message(line, done.stderr)
    assert find_results() == before


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name, contextlib.chdir(name):
        make_folder(Path.cwd())
        sys.path.insert(0, name)
        lines = [block.splitlines()[0] for block in BLOCKS]
        answers = [line if line[0] == "#" else f"{line}\n{answer(line)}" for line in lines]
    PAGE.write_text("\n\n".join(answers) + "\n")
