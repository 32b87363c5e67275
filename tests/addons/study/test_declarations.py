"""Declared studies: statements repeated by names in braces, runs that start from others, tables, and mistakes."""

import pytest
from support.doors import BadInput
from support.made_studies import made_row

from cmacexp.study import ANY, Results, at_most, completed, declare, describe_estimates, of_completed


def steps(runs):
    return runs.measure("steps")


KINDS = {"kind": {"a": {"feedforward": "cmac"}, "c": {}, "b": {"feedforward": "rbf"}}}
STUDY = declare(
    title="T",
    question="Q?",
    common={"set": {"cycles": 3}},
    runs=[
        {"set": {"cycles": 9}, "over": KINDS, "labels": {"part": "before"}, "seeds": True},
        {"quick": {"cycles": 1}, "over": KINDS, "labels": {"part": "after"}, "after": {"part": "before"}},
    ],
    measures={"steps": lambda run: run.manifest["steps"]},
    findings={
        "small_{kind}": {
            "for": {"kind": ["a", "b"]}, "says": "With {kind} it is small",
            "criteria": [
                {"value": steps, "of": {"kind": "{kind}"}, "each": {"part": ["before", "after"]},
                 "case": "{{part}} it", "limit": "at most 5 mm"},
                {"value": steps, "limit": "any mm"},
            ],
        },
        "less": {
            "value": lambda runs: runs.end("force_rmse"), "of": {"part": "a"}, "over": {"part": "b"},
            "limit": "at most 1", "case": "here", "beside": "force error, N",
        },
    },
    tables={
        "steps": {
            "rows": {"kind": "K"},
            "columns": {
                **of_completed({"size": lambda runs: 2 * steps(runs), "late": lambda runs: runs.at(7, "force_rmse")}),
                "done": completed, "both": lambda runs: describe_estimates(runs, steps, lambda runs: 3 * steps(runs)),
            },
        },
    },
)  # fmt: skip


def test_runs_are_a_grid_start_from_those_with_the_same_labels_and_take_what_is_common():
    before, after = STUDY.runs(False)[:3], STUDY.runs(False)[3:]
    assert [each.overrides for each in before[::2]] == [
        ("cycles=9", "feedforward=cmac"), ("cycles=9", "feedforward=rbf"),
    ]  # fmt: skip
    assert [each.starts_from.overrides for each in after] == [each.overrides for each in before]
    assert [each.seeded for each in (before[0], after[0])] == [True, False]


def test_a_quick_form_takes_the_ends_of_each_setting():
    assert [each.labels["kind"] for each in STUDY.runs(True)] == ["a", "b", "a", "b"]
    assert STUDY.runs(True)[2].overrides == ("cycles=3", "feedforward=cmac", "cycles=1")


def test_names_in_braces_repeat_a_statement_and_name_its_cases():
    finding = STUDY.findings["small_b"]
    assert (set(STUDY.findings), finding.says) == ({"small_a", "small_b", "less"}, "With b it is small")
    assert [(each.case, each.of, each.unit) for each in finding.criteria] == [
        ("before it", {"kind": "b", "part": "before"}, "mm"), ("after it", {"kind": "b", "part": "after"}, "mm"),
        ("", {}, "mm"),
    ]  # fmt: skip
    assert [each.holds for each in finding.criteria[1:]] == [at_most(5e-3), ANY]


def test_values_of_a_ratio_stand_beside_it():
    assert [(each.quantity, each.case, each.of, each.holds) for each in STUDY.findings["less"].criteria[1:]] == [
        ("force error", "here, b", {"part": "b"}, ANY), ("force error", "here, a", {"part": "a"}, ANY),
    ]  # fmt: skip


def test_a_cell_of_a_table_is_of_runs_that_completed_and_shows_nothing_of_cycles_that_they_were_not_to_reach():
    rows = [made_row({"force_rmse": [1.0]}, asked, {"steps": size}, kind="a") for asked, size in ((1, 4.0), (2, 8.0))]
    (found,) = STUDY.tables["steps"](Results(rows)).to_dict("records")
    assert found == {"K": "a", "size": 8.0, "late": None, "done": "1 of 2", "both": "5.66 / 17"}


FINDING = {"value": steps, "limit": "at most 1"}


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"run": []}, "study=run: .* did you mean runs"),
        ({"measures": {"size": "os.path.getsize"}}, "measures=size"),
        ({"findings": {"x": {**FINDING, "sais": "A"}}}, "findings=sais: .* did you mean says"),
        ({"findings": {"x": {"value": steps}}}, "criteria=.*needs limit"),
        ({"findings": {"x": {**FINDING, "case": "{foo}"}}}, "case="),
        ({"figures": {"x": {"metric": "force_rms", "by": "seed"}}}, "figures.metric=force_rms: .*force_rmse"),
        ({"tables": {"x": {"rows": "seed", "across": "cycles"}}}, "tables=.*needs value"),
        *(
            ({"findings": {"x": {**FINDING, "limit": limit}}}, "limit=")
            for limit in ("at most 1 %%", "at most 0.1 cm", "1.5 to 1", "at most", "5 any")
        ),
        *(
            ({part: {"x": {**own, **text}}}, r"transfer_rmse\[5\]: must be a function .* lambda runs: runs.at\(5")
            for part, own, text in (
                ("findings", FINDING, {"value": "transfer_rmse[5]"}),
                ("figures", {"over": "seed"}, {"value": "transfer_rmse[5]"}),
                ("tables", {"rows": "seed"}, {"columns": {"error": "transfer_rmse[5]"}}),
            )
        ),
    ],
)
def test_a_mistake_is_refused_before_anything_is_run_and_a_quantity_as_text_says_how_to_write_it_now(wrong, message):
    with pytest.raises(BadInput, match=message):
        declare(**{"title": "T", "question": "Q?", "runs": [], **wrong})


@pytest.mark.parametrize("values", [0.1, "12", []])
def test_values_of_a_setting_must_be_a_list(values):
    study = declare(title="T", question="Q?", runs=[{"over": {"gait.stroke": values}}])
    with pytest.raises(BadInput, match=r"^runs.over.gait.stroke="):
        study.runs(False)


@pytest.mark.parametrize(
    ("part", "own"),
    [
        ("figures", {"metric": "force_rmse", "by": "gait.strok"}),
        ("figures", {"metric": "force_rmse", "by": "gait.stroke", "of": {"gait.strok": 0.1}}),
        ("tables", {"rows": "gait.strok", "columns": {"done": completed}}),
    ],
)
def test_a_setting_that_no_run_has_is_named_wherever_it_stands(part, own):
    results = Results([made_row({"force_rmse": [1.0]}, 1, **{"gait.stroke": 0.1})])
    with pytest.raises(BadInput, match=r"^setting=gait.strok: .* did you mean gait.stroke"):
        getattr(declare(title="T", question="Q?", runs=[], **{part: {"x": own}}), part)["x"](results)
