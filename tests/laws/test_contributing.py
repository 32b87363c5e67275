"""CONTRIBUTING.md: the files that it names exist, its table of rooms is that of the house, its recipes work."""

import re
from pathlib import Path

import pytest
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
    return [span for span in spans if re.fullmatch(r"[\w.-]+(/[\w.-]+)+|\w[\w-]*\.(md|py|toml)", span)]


QUESTIONS = rows(section("Where is ...?"))


@pytest.mark.parametrize("name", sorted(set(files(TEXT))))
def test_every_file_named_exists(name):
    assert (ROOT / name).exists()


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
