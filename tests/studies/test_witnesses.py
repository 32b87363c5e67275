"""What is quoted of a study is what its code gives: two runs, its witnesses, and statements on stored runs."""

import json
from dataclasses import replace

import pytest
from support.robots import needs_models

from pipelines.results import STORED_RUNS, PublishedResults, declared, judge_stored, read_results, repeat_witness

WITNESSES = [
    pytest.param(
        witness,
        id=f"{name}-{number}",
        marks=[
            pytest.mark.nightly if number else pytest.mark.ci,
            *([needs_models] if "scenario=robot" in witness["overrides"] else []),
        ],
    )
    for name, study in read_results().studies.items()
    for number, witness in enumerate(study["witnesses"])
]


@pytest.mark.parametrize("witness", WITNESSES)
def test_a_witness_gives_what_it_gave(witness):
    assert not repeat_witness(witness)


STORED = sorted(path.stem for path in STORED_RUNS.glob("*.json"))


@pytest.mark.parametrize("name", STORED)
def test_statements_give_on_stored_runs_what_they_gave(name):
    assert not judge_stored(name)


def test_stored_runs_belong_to_studies_and_a_fault_of_a_measure_is_noticed(monkeypatch):
    """The force error instead of the transfer error, as a function that several studies share."""
    assert STORED
    assert set(STORED) <= set(declared())
    faulty = {
        name: {
            key: replace(statement, criteria=[replace(c, sample=lambda runs: runs.end("force_rmse", 1))
                                              for c in statement.criteria])
            for key, statement in statements.items()
        }
        for name, statements in declared().items()
    }  # fmt: skip
    monkeypatch.setattr("pipelines.results.declared", lambda: faulty)
    assert all(judge_stored(name) for name in STORED)


@pytest.mark.ci
def test_a_changed_constant_is_noticed_and_equal_values_confirm_a_study(monkeypatch):
    """A leg that is heavier by a millionth gives other metrics than a witness allows."""
    results, name = read_results(), "one_leg_learning"
    monkeypatch.setattr("pipelines.results.digest_package", lambda: {"cmacexp/new.py": "0"})
    heavier = [
        {**w, "overrides": [*w["overrides"], "plant.mass_factor=1.000001"]}
        for w in results.studies[name]["witnesses"]
    ]
    kept, results.studies[name]["witnesses"] = results.studies[name]["witnesses"], heavier
    assert results.confirm(name)
    assert results.find_state(name).state == "changed"
    results.studies[name]["witnesses"] = kept
    assert not results.confirm(name)
    again = PublishedResults(json.loads(results.format()))
    assert again.find_state(name).state == "equal"
    monkeypatch.setattr("pipelines.results.digest_package", lambda: {"cmacexp/new.py": "1"})
    again = PublishedResults(json.loads(results.format()))
    assert again.find_state(name).state == "changed"
