"""Mutation testing: faults are real and where they should be, and reasons belong to faults that exist."""

import ast

from support.command import ROOT

from benchmarks.mutants.__main__ import all_mutants
from benchmarks.mutants.mutations import find_mutants
from benchmarks.mutants.page import read_reasons

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


def test_every_mutant_is_another_program_and_every_reason_is_of_one():
    everything = [mutant for own in all_mutants().values() for mutant in own]
    for mutant in everything[::400]:
        source = (ROOT / mutant.path).read_bytes()
        assert ast.dump(ast.parse(mutant.apply(source))) != ast.dump(ast.parse(source)), mutant
    assert set(read_reasons()) <= {(mutant.path, mutant.context, mutant.old, mutant.new) for mutant in everything}
