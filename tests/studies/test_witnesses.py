"""Two runs of every study that is quoted, its witnesses, give today what they gave when it last ran in full."""

import json

import pytest
from support.robots import needs_models

from pipelines.results import PublishedResults, read_results, repeat_witness

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
    assert again.find_state(name).state == "changed"
