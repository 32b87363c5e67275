"""The study of changing ground: when and how ground and load change."""

import pytest

from cmacexp.config.compose import compose_config
from pipelines.terrain import CHANGES, CMAC, FEEDBACK, INFORMED, STUDY, UNCHANGED


def walk_of(change: str, walk: str):
    (request,) = [r for r in STUDY.runs(False) if (r.labels.get("change"), r.labels["walk"]) == (change, walk)]
    return compose_config(request.with_seed(0).overrides)


@pytest.mark.parametrize("change", CHANGES)
def test_a_change_comes_between_two_cycles_and_in_the_walks_that_have_it_alone(change):
    for walk in (CMAC, FEEDBACK):
        config = walk_of(change, walk)
        time = config.terrain.step_time if config.payload.weight == 0.0 else config.payload.time
        assert 0.0 < time < config.cycles * config.gait.cycle_time
        assert time % config.gait.cycle_time == 0.0
    unchanged = walk_of(change, UNCHANGED)
    assert unchanged.terrain.step_time is None
    assert unchanged.payload.weight == 0.0


@pytest.mark.parametrize("change", [name for name, change in CHANGES.items() if change.known])
def test_a_plan_that_knows_has_the_ground_and_the_weight_after_the_change(change):
    before, after, known = (walk_of(change, walk) for walk in (UNCHANGED, CMAC, INFORMED))
    assert known.terrain.stiffness == before.terrain.stiffness * after.terrain.step_factor
    if change != "leg":  # which has no body
        assert known.machine.weight == before.machine.weight + after.payload.weight


def test_every_seed_walks_over_other_patches():
    patched = [r for r in STUDY.runs(False) if r.labels.get("ground") == "patches"]
    seeds = {compose_config(r.with_seed(seed).overrides).terrain.patch_seed for r in patched for seed in (0, 1, 2)}
    assert seeds == {0, 1, 2}
