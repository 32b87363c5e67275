"""CONTRIBUTING.md: the files that it names exist, its table of rooms is that of the house, its recipes work."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest
from numpy.testing import assert_allclose
from test_house import LAYERS

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "CONTRIBUTING.md").read_text()
MOST_FILES = 3
"""Files that answer a question."""


def section(title: str) -> str:
    """The text below a heading, up to the next one of its level."""
    _, found = re.split(rf"^## {re.escape(title)}\n", TEXT, flags=re.MULTILINE)
    return re.split(r"^## ", found, flags=re.MULTILINE)[0]


def rows(text: str) -> list[list[str]]:
    """Cells of the rows of the first table in ``text``, without its head."""
    lines = [line for line in text.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


def files(text: str) -> list[str]:
    """Paths of files and folders in ``text``, as they stand in code spans."""
    spans = re.findall(r"`([^`\n]+)`", text)
    return [span for span in spans if re.fullmatch(r"[\w.-]+(/[\w.-]+)+|\w[\w-]*\.(md|py|txt|toml)", span)]


QUESTIONS = rows(section("Where is ...?"))


@pytest.mark.parametrize("name", sorted(set(files(TEXT))))
def test_every_file_named_exists(name):
    assert list(ROOT.glob(name.replace("NAME", "*")))


@pytest.mark.parametrize(("question", "answer"), QUESTIONS)
def test_a_question_is_answered_by_few_files(question, answer):
    assert 1 <= len(files(answer)) <= MOST_FILES, question


def test_the_map_answers_many_questions():
    assert len(QUESTIONS) >= 20


def test_the_rooms_stand_in_the_order_of_the_layers():
    listed = [re.findall(r"`(\w+)`", row[0]) for row in rows(section("Rooms"))]
    order = {room: k for k, layer in enumerate(LAYERS) for room in layer}
    places = [order[room] for rooms in listed for room in rooms]
    assert places == sorted(places)
    assert {room for rooms in listed for room in rooms} == set(order)


def snippets() -> list[str]:
    """Python blocks of the page, each beginning with a comment that says where it belongs."""
    return re.findall(r"^```python\n(.*?)^```", TEXT, flags=re.DOTALL | re.MULTILINE)


def insert(snippet: str, root: Path) -> None:
    """Put a snippet above the definition that its first line names, or at the end of the table of that name."""
    head, body = snippet.split("\n", 1)
    name, place, table = re.fullmatch(r"# (\S+), (above|in) (\w+)", head).groups()
    text = (root / name).read_text()
    at = re.search(rf"^{table}\b", text, flags=re.MULTILINE).start()
    if place == "above":
        body += "\n\n"
    else:
        at = text.index("\n}\n", at) + 1
    (root / name).write_text(text[:at] + body + text[at:])


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A function that makes a short run, in plain Python, with a copy of the package that has all additions."""
    root = tmp_path_factory.mktemp("additions")
    for folder in ("cmacexp", "conf"):
        shutil.copytree(ROOT / folder, root / folder, ignore=shutil.ignore_patterns("__pycache__"))
    for snippet in snippets():
        insert(snippet, root)

    def run(name: str, *overrides: str) -> Path:
        command = [
            "-m",
            "cmacexp",
            "cycles=2",
            "sampling_period=0.01",
            "record=trace",
            *overrides,
            f"hydra.run.dir={root / name}",
        ]
        environment = {**os.environ, "PYTHONPATH": str(root), "NUMBA_DISABLE_JIT": "1"}
        subprocess.run([sys.executable, *command], cwd=root, env=environment, check=True)
        return root / name

    return run


@pytest.fixture(scope="module")
def with_rule(run):
    """A run that learns by the rule that is added."""
    return run("neighbours", "learning.rule=neighbours")


def test_a_metric_is_added_as_described(with_rule):
    trace = pd.read_parquet(with_rule / "trace.parquet")
    torques = [(trace[f"tau_feedback_{j}"] + trace[f"tau_feedforward_{j}"]).abs() for j in (1, 2)]
    by_hand = (sum(torques) / 2.0).groupby(trace["cycle"]).mean()
    assert_allclose(pd.read_parquet(with_rule / "metrics.parquet")["torque_mean"], by_hand)


def test_a_rule_is_added_as_described(run, with_rule):
    same = run("zero_phase", "learning.rule=zero_phase", "learning.leakage=0")
    own, same = (pd.read_parquet(folder / "trace.parquet") for folder in (with_rule, same))
    assert own.equals(same)
    assert own["tau_feedforward_1"].any()


MOST_TOUCHED = {
    "a metric": 3,
    "a learning rule": 3,
    "a gait": 2,
    "a plant": 3,
    "a feedforward": 3,
    "a fault of a sensor": 2,
    "a signal": 3,
    "a study": 2,
}
ADDITIONS = dict(rows(section("How to add ...")))


@pytest.mark.parametrize(("what", "most"), MOST_TOUCHED.items())
def test_an_addition_touches_few_files(what, most):
    assert 1 <= len(files(ADDITIONS[what])) <= most
