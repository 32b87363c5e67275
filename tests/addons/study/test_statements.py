"""Studies: grids of runs, statements whose verdict an interval decides, and what a study refuses."""

import math
from dataclasses import replace
from pathlib import Path

import pytest
from support.doors import BadInput
from support.made_studies import made_errors

from cmacexp.addons.study.interval import ONE_SEED, UNPAIRED
from cmacexp.addons.study.provenance import digest_source
from cmacexp.addons.study.results import NoSuchRuns
from cmacexp.addons.study.statements import UNDECIDED, StatementResult
from cmacexp.study import (
    ANY,
    Claim,
    Criterion,
    Finding,
    Panel,
    Results,
    at_least,
    at_most,
    between,
    grid,
    starting_from,
)

ONE = made_errors(0.1, machine="leg")


OPPOSITE = at_least(2.0)


def criterion(*sample: float, fails=OPPOSITE) -> Criterion:
    return Criterion("error", lambda results: list(sample), at_most(1.0), fails)


def judge(*criteria: Criterion) -> StatementResult:
    return Claim("it is small", "section 1", criteria).judge(ONE)


def test_a_run_starts_from_the_one_run_with_its_labels_and_its_seed():
    kinds = {"a": ["feedforward=cmac"], "b": ["feedforward=rbf"]}
    before, after = (grid(text, over={"kind": kinds}, seeded=True) for text in ("cycles=9", "gait.stroke=0.1"))
    second = starting_from(before, after)[1].with_seed(4)
    assert second.overrides == ("gait.stroke=0.1", "feedforward=rbf", "seed=4")
    assert second.starts_from.overrides == ("cycles=9", "feedforward=rbf", "seed=4")
    values = grid("cycles=9", over={"cmac.layers": [8, 16]})  # are no labels: both runs would match
    for pair in ((values, values), (before[:1], after)):
        with pytest.raises(BadInput):
            starting_from(*pair)


@pytest.mark.parametrize(
    ("samples", "verdict"),
    [
        ([[0.5]], "reproduced"),
        ([[1.0]], "reproduced"),
        ([[0.5], [1.5]], "reproduced in part"),
        ([[0.5], [3.0]], "reproduced in part"),
        ([[1.5]], "not reproduced"),
        ([[1.9, 2.1]], "not reproduced"),
        ([[1.5], [3.0]], "not reproduced"),
        ([[3.0]], "contradicted"),
        ([[0.9, 1.1]], "inconclusive"),
        ([[0.5], [0.9, 1.1]], "inconclusive"),
        ([[0.5, math.inf]], "inconclusive"),
        ([[UNPAIRED]], "inconclusive"),
    ],
)
def test_each_verdict_from_where_the_intervals_lie(samples, verdict):
    assert judge(*(criterion(*sample) for sample in samples)).verdict == verdict


@pytest.mark.parametrize("sample", [[7.0], [math.inf]])
def test_a_value_without_a_limit_stands_beside_others_and_decides_nothing(sample):
    beside = Criterion("height", lambda results: sample, ANY)
    assert judge(criterion(1.5), beside).verdict == "not reproduced"
    assert judge(criterion(0.5), beside).verdict == "reproduced"


def test_one_seed_decides_nothing_unless_no_seed_changes_the_run():
    rows = [replace(row, seeded=True) for row in ONE.rows]
    small = Finding([Criterion("error", lambda results: results.at(5, "transfer_rmse_x"), at_most(1.0))])
    (measured,) = small.judge(Results(rows)).measured
    assert (measured.spread, measured.verdict) == (ONE_SEED, "inconclusive")
    assert small.judge(ONE).verdict == "yes"


OWN = ("It is {value}.", "It is not: {value}.", "Unclear: {value}.")


@pytest.mark.parametrize(
    ("sample", "outcome", "own"),
    [
        ([5e-4], "yes (0.5 mm [deterministic]", "It is 0.5 mm."),
        ([1.5e-3], "no (1.5 mm [deterministic]", "It is not: 1.5 mm."),
        ([9e-4, 1.1e-3], "undecided (1 mm [0.9 to 1.1 mm (min, max)]", "Unclear: 1 mm."),
    ],
)
def test_a_finding_says_what_came_out_and_of_how_much_or_its_own_sentence(sample, outcome, own):
    measured = Criterion("error", lambda results: sample, at_most(1e-3), unit="mm", scale=1e3)
    text = f"It is small: {outcome}, n = {len(sample)}; limit at most 1 mm)."
    assert Finding([measured], says="It is small").judge(ONE).sentence == text
    assert Finding([measured], *OWN).judge(ONE).sentence == own
    if "Unclear" in own:
        assert Finding([measured], "Yes.", "No.").judge(ONE).sentence == UNDECIDED.format("Yes.")


@pytest.mark.parametrize("wrong", ["{valeu}", "{values[1]}", "{values[a]}", "{values.first}", "{value", "{}"])
@pytest.mark.parametrize("outcome", ["yes", "no", "unclear"])
def test_a_wrong_name_in_braces_is_an_error_before_the_outcome_that_shows_it(wrong, outcome):
    sentences = {"yes": "{value}", "no": "{values[0]}", "unclear": "{{}}"}
    Finding([criterion(0.5)], **sentences)
    with pytest.raises(BadInput):
        Finding([criterion(0.5)], **{**sentences, outcome: wrong})


def judge_sample(sample, **options):
    Finding([Criterion("error", sample, at_most(1.0), **options)]).judge(ONE)


@pytest.mark.parametrize(
    ("wrong", "key"),
    [
        (lambda: judge_sample(lambda results: []), "quantity"),
        (lambda: judge_sample(lambda results: [1.0, math.nan]), "quantity"),
        (lambda: judge_sample(lambda results: [1.0], of={"machine": "robot"}), "quantity"),
        (lambda: judge_sample(lambda results: results.select(machine="robot").measure("x")), "quantity"),
        (lambda: ONE.at(6, "transfer_rmse_x"), "cycle"),  # of a run that completed: not the worst value
        (lambda: ONE.at(0, "transfer_rmse_x"), "cycle"),
        (lambda: ONE.at(1, "transfer_rmse_w"), "metric"),
        (lambda: ONE.end("transfer_rmse_w"), "metric"),
        (lambda: ONE.measure("mass"), "measure"),
        (lambda: Panel("error", "cycle", "mm", [], kind="bar"), "kind"),
        (lambda: Panel("error", "cycle", "mm", [], log="yx"), "log"),
        (lambda: Finding([], says="It is."), "finding"),
        (lambda: Finding([Criterion("error", lambda results: [1.0], ANY)], says="It is."), "finding"),
        (lambda: Claim("it is small", "section 1", []), "claim"),
    ],
)
def test_a_mistake_is_an_error_that_names_what_is_wrong(wrong, key):
    with pytest.raises(BadInput, match=f"^{key}="):
        wrong()


def test_a_selection_without_runs_names_what_there_is():
    results = Results([*ONE.rows, *made_errors(0.2, machine="walk").rows])
    assert len(results.select(machine=["leg", "walk"])) == 2
    with pytest.raises(NoSuchRuns, match=r"machine=robot: .*'leg', 'walk'"):
        results.select(machine="robot")
    with pytest.raises(BadInput, match=r"^setting=machin: .* did you mean machine"):
        results.by("machin")


def test_a_digest_leaves_out_docstrings_and_nothing_else(tmp_path):
    def digest(text: str, path=Path("a.py")) -> str:
        (tmp_path / path).write_text(text)
        return digest_source(tmp_path / path)

    plain = digest("def f():\n    return 1\n")
    assert digest('"""About it."""\n\ndef f():\n    """Give\n    one."""\n    return 1\n') == plain
    assert digest("def f():\n    return 2\n") != plain
    assert digest('def f(x=1): "text"\n') != digest('def f(x=2): "text"\n')  # code stands on the line too
    assert digest("a: 1 # one\n", "a.yaml") == digest("a:   1\n", "a.yaml") != digest("a: 2\n", "a.yaml")


@pytest.mark.parametrize(
    ("holds", "fails", "signed"),
    [(at_most(1.0), None, False), (at_least(0.5), at_most(0.1), False), (ANY, None, False),
     (at_least(0.0), None, True), (between(-0.1, 0.1), None, True), (at_least(1.0), at_most(0.0), True)],
)  # fmt: skip
def test_a_quantity_is_signed_if_a_limit_reaches_zero(holds, fails, signed):
    assert Criterion("growth", lambda results: [], holds, fails).is_signed == signed
