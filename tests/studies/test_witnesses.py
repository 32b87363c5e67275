"""Two runs of every study that is quoted, its witnesses, give today what they gave when it last ran in full."""

import math

import pytest
from support.doors import package_models

import cmacexp
from pipelines.results import read_results

CLOSE = 1e-9
"""Relative; the last digits differ between processors."""
WITNESSES = [
    pytest.param(witness, id=f"{name}-{number}", marks=pytest.mark.nightly if number else pytest.mark.ci)
    for name, study in read_results().studies.items()
    for number, witness in enumerate(study["witnesses"])
]


def needs_models(overrides: list[str]) -> bool:
    return "scenario=robot" in overrides and not package_models()


def repeat(overrides: list[str], folder) -> dict[str, float]:
    """The metrics of the last whole cycle of a run."""
    run = cmacexp.run([*overrides, "record=metrics", "warn=false"], folder)
    return {name: run.final(name) for name in run.pooled}


@pytest.mark.parametrize("witness", WITNESSES)
def test_a_witness_gives_what_it_gave(witness, tmp_path):
    if needs_models(witness["overrides"]):
        pytest.skip("models of robots are not installed: pip install '.[robots]'")
    found = repeat(witness["overrides"], tmp_path / "run")
    expected = {name: math.nan if value is None else value for name, value in witness["metrics"].items()}
    assert found == pytest.approx(expected, rel=CLOSE, nan_ok=True)


@pytest.mark.ci
def test_a_changed_constant_is_noticed(tmp_path):
    """A leg that is heavier by a millionth gives other metrics than a witness allows."""
    studies = read_results().studies.values()
    overrides = next(
        w["overrides"] for study in studies for w in study["witnesses"] if not needs_models(w["overrides"])
    )
    before = repeat(overrides, tmp_path / "before")
    after = repeat([*overrides, "plant.mass_factor=1.000001"], tmp_path / "after")
    assert after != pytest.approx(before, rel=CLOSE, nan_ok=True)
