"""Mutation testing: faults are real and where they should be, and reasons belong to mutants that exist."""

import ast
import random
from pathlib import Path

import pytest

from tests.mutants.__main__ import all_mutants
from tests.mutants.mutations import find_mutants, sample
from tests.mutants.page import read_reasons

ROOT = Path(__file__).parents[2]
SOURCE = '''"""Not 1 + 1."""

LIMIT: "int | None" = 2


@kernel
def clip(value: "float | None", limit=LIMIT) -> float:
    """Nor 1 + 1."""
    if value > limit:
        raise ValueError(f"{value + limit} is more than {1 + 1}")
    return max(value, -limit)


def describe(value: float) -> str:
    """Text."""
    return "many" if value > 1 else "one"
'''


@pytest.fixture(scope="module")
def mutants():
    return all_mutants()


def test_mutants_are_of_mathematics_and_know_their_function():
    found = {(mutant.line, mutant.function, mutant.old, mutant.new) for mutant in find_mutants("clip.py", SOURCE)}
    assert found == {
        (3, 0, "2", "3"),
        (3, 0, "2", "1"),
        (9, 6, "value > limit", "((value) >= (limit))"),
        (9, 6, "value > limit", "((value) <= (limit))"),
        (9, 6, "value > limit", "(not (value > limit))"),
        (11, 6, "max", "min"),
        (11, 6, "-limit", "(limit)"),
    }


def test_every_mutant_is_another_program(mutants):
    everything = [mutant for own in mutants.values() for mutant in own]
    for mutant in random.Random(0).sample(everything, 30):
        source = (ROOT / mutant.path).read_bytes()
        mutated = ast.dump(ast.parse(mutant.apply(source)))
        assert mutated != ast.dump(ast.parse(source)), mutant


def test_a_sample_is_that_of_its_seed_and_has_mutants_of_every_file(mutants):
    drawn = sample(mutants, 100, 2, seed=5)
    assert drawn == sample(mutants, 100, 2, seed=5) != sample(mutants, 100, 2, seed=6)
    assert len(set(drawn)) == len(drawn)
    assert {mutant.path for mutant in drawn} == set(mutants)


def test_a_reason_is_of_a_mutant_that_still_exists(mutants):
    exist = {(m.path, m.context, m.old, m.new) for own in mutants.values() for m in own}
    assert set(read_reasons()) <= exist


def test_the_page_has_its_tables():
    page = (ROOT / "docs" / "mutants.md").read_text()
    assert "| survived |" in page
    assert "| why it survives |" in page
