"""Mutation testing: faults are real and where they should be, and reasons belong to mutants that exist."""

import ast
import os
import random
from pathlib import Path

import pytest

from benchmarks.mutants.__main__ import all_mutants
from benchmarks.mutants.calls import REPORT, Reporting
from benchmarks.mutants.mutations import find_mutants, sample
from benchmarks.mutants.page import read_reasons
from benchmarks.mutants.session import call_apart
from benchmarks.mutants.trial import (
    BUDGET,
    FIGURES,
    FIGURES_ONLY,
    KILLED,
    SURVIVED,
    choose_tests,
    codes,
    judge,
)

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


def test_functions_report_their_calls_as_their_mutants_name_them(mutants):
    tree = ast.fix_missing_locations(Reporting("clip.py").visit(ast.parse(SOURCE)))
    reported: list[tuple[str, int]] = []
    names = {"kernel": lambda function: function, REPORT: reported.append}
    exec(compile(tree, "clip.py", "exec"), names)
    assert names["clip"](1.0) == 1.0
    assert names["clip"].__doc__ == "Nor 1 + 1."
    assert reported == [("clip.py", 6)]
    for path, own in mutants.items():
        reporting = ast.walk(Reporting(path).visit(ast.parse((ROOT / path).read_text())))
        calls = (node for node in reporting if isinstance(node, ast.Call) and getattr(node.func, "id", "") == REPORT)
        lines = {call.args[0].value[1] for call in calls}
        assert {mutant.function for mutant in own} <= {0, *lines}


def test_code_with_a_fault_has_the_same_functions(mutants):
    """So that one can replace the other."""
    for mutant in random.Random(1).sample([mutant for own in mutants.values() for mutant in own], 20):
        source = (ROOT / mutant.path).read_bytes()
        before, after = (codes(compile(text, "file", "exec")) for text in (source, mutant.apply(source)))
        assert [code.co_qualname for code in before] == [code.co_qualname for code in after]


def test_the_quickest_tests_of_a_function_that_fit_are_chosen_and_figures_come_last(mutants):
    mutant = next(own for own in mutants["cmacexp/models/lead.py"] if own.function)
    called = [["models/lead.py", mutant.function]]
    seconds = {"b::slow": 0.6 * BUDGET, "b::quick": 0.1, "a::slower": 0.7 * BUDGET, "a::other": 0.2}
    seconds |= {f"{FIGURES[0]}::all": 2.0 * BUDGET, "c::fixture": 0.3}
    calls = {test: called for test in seconds if test not in ("a::other", "c::fixture")} | {"c": called}
    record = {"seconds": seconds, "calls": calls, "early": []}
    assert choose_tests(mutant, record) == ["c::fixture", "b::quick", "b::slow", f"{FIGURES[0]}::all"]
    found = {failed: judge(mutant, [], failed)["result"] for failed in ("", "b::quick", f"{FIGURES[0]}::all", None)}
    assert list(found.values()) == [SURVIVED, KILLED, FIGURES_ONLY, KILLED]


def test_a_process_apart_returns_a_result_or_nothing_and_an_error_is_raised():
    assert call_apart(lambda: 7) == 7
    assert call_apart(os._exit, 1) is None
    with pytest.raises(RuntimeError, match="ZeroDivisionError"):
        call_apart(lambda: 1 / 0)


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
