"""Studies declared in YAML: statements repeated by names in braces, runs that start from others, measures by name."""

import pytest
from support.doors import BadInput, load_study
from support.made_studies import made_row

from cmacexp.study import ANY, Results, at_most, declare

TEXT = """
title: T
question: Q?
runs:
  - {set: {cycles: 9}, over: &kinds {kind: {a: {feedforward: cmac}, b: {feedforward: rbf}}}, labels: {part: before}}
  - {set: {cycles: 3}, quick: {cycles: 1}, over: *kinds, labels: {part: after}, after: {part: before}}
measures: {steps: os.path.getsize}
findings:
  "small_{kind}":
    for: {kind: [a, b]}
    says: With {kind} it is small
    criteria:
      - {value: steps, of: {kind: "{kind}"}, each: {part: [before, after]}, case: "{{part}} it", limit: at most 5 mm}
      - {value: steps, limit: any mm}
tables:
  steps: {rows: {kind: K}, columns: {size: 2 * steps, done: completed, both: [steps, 3 * steps]}}
"""


@pytest.fixture
def study(tmp_path):
    (tmp_path / "some.yaml").write_text(TEXT)
    return load_study(tmp_path / "some.yaml").study


def test_runs_of_a_declaration_are_a_grid_and_start_from_those_with_the_same_labels(study):
    before, after = study.runs(False)[:2], study.runs(False)[2:]
    assert [each.overrides for each in before] == [("cycles=9", "feedforward=cmac"), ("cycles=9", "feedforward=rbf")]
    assert [each.starts_from.overrides for each in after] == [each.overrides for each in before]
    assert study.runs(True)[2].overrides == ("cycles=3", "feedforward=cmac", "cycles=1")


def test_names_in_braces_repeat_a_statement_and_name_its_cases(study):
    finding = study.findings["small_b"]
    assert (set(study.findings), finding.says) == ({"small_a", "small_b"}, "With b it is small")
    assert [(each.case, each.of, each.unit) for each in finding.criteria] == [
        ("before it", {"kind": "b", "part": "before"}, "mm"), ("after it", {"kind": "b", "part": "after"}, "mm"),
        ("", {}, "mm"),
    ]  # fmt: skip
    assert [each.holds for each in finding.criteria[1:]] == [at_most(5e-3), ANY]


def test_what_a_part_does_not_say_is_common_and_values_of_a_ratio_stand_beside_it():
    study = declare(
        title="T",
        question="Q?",
        common={"set": {"cycles": 3}, "seeds": True},
        runs=[{}, {"seeds": False}],
        findings={
            "less": {
                "value": "force_rmse", "of": {"part": "a"}, "over": {"part": "b"}, "limit": "at most 1",
                "case": "here", "beside": "force error, N",
            },
        },
    )  # fmt: skip
    assert [(each.overrides, each.seeded) for each in study.runs(False)] == [
        (("cycles=3",), own) for own in (True, False)
    ]
    assert [(each.quantity, each.case, each.of, each.holds) for each in study.findings["less"].criteria[1:]] == [
        ("force error", "here, b", {"part": "b"}, ANY), ("force error", "here, a", {"part": "a"}, ANY),
    ]  # fmt: skip


def test_a_cell_of_a_table_is_of_runs_that_completed_and_may_show_several_values(study):
    rows = [made_row({"force_rmse": [1.0]}, asked, {"steps": size}, kind="a") for asked, size in ((1, 4.0), (2, 8.0))]
    (found,) = study.tables["steps"](Results(rows)).to_dict("records")
    assert found == {"K": "a", "size": 8.0, "done": "1 of 2", "both": "6 / 18"}


@pytest.mark.parametrize("target", ["nothing.here", "os.path.nothing", "size"])
def test_a_measure_that_is_no_function_is_refused(target, tmp_path):
    (tmp_path / "some.yaml").write_text(TEXT.replace("os.path.getsize", target))
    with pytest.raises(BadInput, match=r"^measures="):
        load_study(tmp_path / "some.yaml")


def test_a_quick_form_takes_the_ends_of_each_setting_and_shows_nothing_of_cycles_that_it_does_not_reach(tmp_path):
    text = TEXT.replace("b: {feedforward: rbf}", "c: {}, b: {feedforward: rbf}").replace(
        "2 * steps", '"force_rmse[7]"'
    )
    (tmp_path / "some.yaml").write_text(text)
    study = load_study(tmp_path / "some.yaml").study
    assert [each.labels["kind"] for each in study.runs(True)] == ["a", "b", "a", "b"]
    row = made_row({"force_rmse": [1.0]}, 1, {"steps": 1.0}, kind="a")
    assert study.tables["steps"](Results([row]))["size"].tolist() == [None]


@pytest.mark.parametrize(
    ("part", "own"),
    [
        ("figures", {"metric": "force_rmse", "by": "gait.strok"}),
        ("figures", {"metric": "force_rmse", "by": "gait.stroke", "of": {"gait.strok": 0.1}}),
        ("figures", {"value": 'setting("gait.strok")', "over": "gait.stroke"}),
        ("tables", {"rows": "gait.strok", "columns": {"done": "completed"}}),
        ("tables", {"rows": "gait.stroke", "columns": {"stroke": 'setting("gait.strok")'}}),
    ],
)
def test_a_setting_that_no_run_has_is_named_wherever_it_stands(part, own):
    results = Results([made_row({"force_rmse": [1.0]}, 1, **{"gait.stroke": 0.1})])
    with pytest.raises(BadInput, match=r"^setting=gait.strok: .* did you mean gait.stroke"):
        getattr(declare(title="T", question="Q?", runs=[], **{part: {"x": own}}), part)["x"](results)
