"""Studies: grids of runs, samples, intervals, and statements that can come out every way."""

import math
import re
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from cmacexp.errors import BadInput
from cmacexp.report.run_summary import RunSummary
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
from cmacexp.study.curves import over_setting
from cmacexp.study.evidence import evidence_of, format_html, format_text
from cmacexp.study.interval import EXACT, FEW, NO_REFERENCE, ONE_SEED, Interval, estimate
from cmacexp.study.page import make_claims_section
from cmacexp.study.provenance import digest_source
from cmacexp.study.results import NoSuchRuns, Row
from cmacexp.study.samples import per_seed, quotients, ratio, relative
from cmacexp.study.statements import UNDECIDED, VERDICTS, Judged, Measured
from cmacexp.study.tables import completed, ends, tabulate
from pipelines.common_results import cross_tabulate, describe_end, draw_cycles, percent


def made(*errors: float, asked: int = 5, **settings) -> Results:
    """A run for each final error; one of NaN fell after two cycles."""
    rows = []
    for error in errors:
        fell = math.isnan(error)
        history = np.linspace(1.0, 0.5 if fell else error, 2 if fell else asked)
        status = "fell" if fell else "completed"
        summary = RunSummary(
            Path("run"), status, "", {}, len(history), {"transfer_rmse_x": history, "feedforward_share": history}
        )
        rows.append(Row(summary, settings, settings, {}))
    return Results(rows)


def last_error(results: Results) -> np.ndarray:
    return results.at(5, "transfer_rmse_x")


def test_a_grid_is_every_combination_and_labels_name_bundles():
    kinds = {"none": ["feedforward=none"], "both": ["feedforward=cmac", "learning.lead=1"]}
    found = grid("cycles=9", over={"cmac.layers": [8, 16], "kind": kinds}, machine="leg")
    assert [request.overrides for request in found] == [
        ("cycles=9", "cmac.layers=8", "feedforward=none"),
        ("cycles=9", "cmac.layers=8", "feedforward=cmac", "learning.lead=1"),
        ("cycles=9", "cmac.layers=16", "feedforward=none"),
        ("cycles=9", "cmac.layers=16", "feedforward=cmac", "learning.lead=1"),
    ]
    assert [dict(request.labels) for request in found[:2]] == [
        {"machine": "leg", "kind": "none"},
        {"machine": "leg", "kind": "both"},
    ]


def test_a_run_starts_from_the_weights_of_the_run_with_its_labels_and_its_seed():
    kinds = {"a": ["feedforward=cmac"], "b": ["feedforward=rbf"]}
    before, after = (grid(text, over={"kind": kinds}, seeded=True) for text in ("cycles=9", "gait.stroke=0.1"))
    second = starting_from(before, after)[1].with_seed(4)
    assert second.overrides == ("gait.stroke=0.1", "feedforward=rbf", "seed=4")
    assert second.starts_from.overrides == ("cycles=9", "feedforward=rbf", "seed=4")


def test_a_run_starts_from_one_run_or_it_is_an_error():
    before = grid("cycles=9", over={"cmac.layers": [8, 16]})  # values are no labels: both would match
    with pytest.raises(BadInput):
        starting_from(before, grid("cycles=9", over={"cmac.layers": [8, 16]}))
    with pytest.raises(BadInput):
        starting_from(grid("cycles=9", kind="a"), grid("cycles=9", kind="b"))


def test_wilson_s_interval_of_38_of_40():
    """Agresti & Coull 1998: (p + z^2/2n -+ z sqrt(pq/n + z^2/4n^2)) / (1 + z^2/n)."""
    z, p, n = 1.959964, 0.95, 40
    centre, reach = p + z**2 / (2 * n), z * math.sqrt(p * (1 - p) / n + z**2 / (4 * n**2))
    found = estimate([True] * 38 + [False] * 2)
    assert (found.low, found.high) == pytest.approx(
        [(centre - reach) / (1 + z**2 / n), (centre + reach) / (1 + z**2 / n)]
    )


def test_values_that_nothing_changes_are_exact():
    assert estimate([2.0, 2.0, 2.0]) == Interval(2.0, 2.0, 2.0, 3, EXACT)


def test_fewer_than_ten_values_have_student_s_t_and_more_a_bootstrap():
    three = estimate([1.0, 2.0, 3.0])
    reach = 4.302653 / math.sqrt(3)  # 97.5 % quantile of Student's t with two degrees of freedom; deviation 1
    assert (three.low, three.value, three.high) == pytest.approx((2.0 - reach, 2.0, 2.0 + reach))
    many = estimate(np.random.default_rng(0).normal(5.0, 1.0, 100))
    assert many.low < 5.0 < many.high
    assert many.high - many.low < 0.6
    assert estimate([1.0] * 5 + [1.1] * 4 + [1e9]).value == pytest.approx(1.05, abs=0.02)  # outliers do not move it


def test_positive_ratios_have_an_interval_of_their_logarithms():
    ratios = np.array([0.5, 0.8, 1.25, 2.0])
    found, turned = (estimate(each, dimensionless=True) for each in (ratios, 1.0 / ratios))
    assert (found.value, found.low, found.high) == pytest.approx((1.0, 1.0 / turned.high, 1.0 / turned.low))
    assert estimate([-0.5, 0.5], dimensionless=True).value == 0.0


SIZES = [(3, False), (3, True), (5, False), (9, True), (FEW, False), (20, False)]


@pytest.mark.parametrize(("size", "dimensionless"), SIZES)
def test_intervals_cover_the_true_value_in_95_per_cent_of_the_draws(size, dimensionless):
    """Of normal values, and of ratios whose median is 1; the limits are those of 2,000 draws."""
    drawn = np.random.default_rng(3).normal(0.0, 0.3, (2000, size))
    samples, truth = (np.exp(drawn), 1.0) if dimensionless else (drawn, 0.0)
    found = [estimate(sample, dimensionless) for sample in samples]
    assert 0.93 <= np.mean([each.low <= truth <= each.high for each in found]) <= 0.97


def test_runs_that_failed_are_counted_apart_and_meet_no_limit():
    sample = last_error(made(0.1, 0.3, float("nan")))
    assert sample.tolist() == [0.1, 0.3, math.inf]
    found = estimate(sample)
    assert (found.value, found.size, found.failed, found.reach) == (pytest.approx(0.2), "2 of 3", 1, math.inf)
    assert not at_most(1e9).contains(found)
    assert made(float("nan")).at(5, "feedforward_share").tolist() == [0.0]
    assert made(0.1, float("nan")).end("transfer_rmse_x").tolist()[1] == math.inf


def test_a_pair_whose_reference_failed_says_nothing():
    found = estimate(quotients(np.array([1.0, 2.0, math.inf, 1.0]), np.array([2.0, math.inf, 1.0, 2.0])))
    assert (found.value, found.size, found.failed, found.unpaired) == (0.5, "2 of 4", 1, 1)
    share = percent("error", lambda results: quotients(np.ones(2), np.full(2, math.inf)), at_most(0.1))
    (measured,) = Finding([share], "yes", "no").judge(made(0.1)).measured
    assert (measured.value, measured.verdict, measured.interval.size) == (NO_REFERENCE, "inconclusive", "0 of 2")


def test_one_seed_decides_nothing():
    rows = [replace(row, seeded=True) for row in made(0.1, seed=0).rows]
    small = Criterion("error", last_error, at_most(1.0))
    (measured,) = Finding([small], "yes", "no").judge(Results(rows)).measured
    assert (measured.spread, measured.verdict) == (ONE_SEED, "inconclusive")
    assert Finding([small], "yes", "no").judge(made(0.1, seed=0)).outcome == "yes"  # no seed changes it


@pytest.mark.parametrize("sample", [[], [1.0, float("nan")]])
def test_an_empty_sample_and_an_undefined_value_are_errors(sample):
    criterion = Criterion("error", lambda results: sample, at_most(1.0))
    with pytest.raises(BadInput, match="quantity=error: "):
        Claim("it is small", "section 1", [criterion]).judge(made(0.1))


@pytest.mark.parametrize("options", [{"of": {"machine": "robot"}}, {}])
def test_a_criterion_without_runs_is_an_error_that_names_it(options):
    measured = Criterion(
        "error", lambda results: last_error(results.select(machine="robot")), at_most(1.0), **options
    )
    with pytest.raises(BadInput, match="quantity=error: "):
        Claim("it is small", "section 1", [measured]).judge(made(0.1, machine="leg"))


def test_a_selection_without_runs_names_what_there_is():
    results = Results([*made(0.1, machine="leg").rows, *made(0.2, machine="walk").rows])
    assert len(results.select(machine=["leg", "walk"])) == 2
    with pytest.raises(NoSuchRuns, match=r"'robot'.*'leg', 'walk'"):
        results.select(machine="robot")
    with pytest.raises(NoSuchRuns, match=r"'machin'.* machine"):
        results.by("machin")


@pytest.mark.parametrize(("option", "value"), [("kind", "bar"), ("log", "yx")])
def test_a_panel_of_an_unknown_kind_is_an_error(option, value):
    with pytest.raises(BadInput, match=f"{option}={value}: "):
        Panel("error", "cycle", "mm", [], **{option: value})


def test_a_cycle_after_the_end_of_a_completed_run_is_an_error_not_the_worst_value():
    with pytest.raises(BadInput, match="cycle=6: "):
        made(0.1).at(6, "transfer_rmse_x")


def test_an_unknown_metric_or_measure_names_the_nearest():
    for wrong in (lambda r: r.end("transfer_rmse_w"), lambda r: r.at(1, "transfer_rmse_w")):
        with pytest.raises(BadInput, match=r"metric=transfer_rmse_w: .* transfer_rmse_[xy]"):
            wrong(made(0.1))
    with pytest.raises(BadInput, match="measure=mass: "):
        made(0.1).measure("mass")


OPPOSITE = at_least(2.0)


def criterion(*sample: float, fails=OPPOSITE) -> Criterion:
    return Criterion("error", lambda results: list(sample), at_most(1.0), fails)


@pytest.mark.parametrize(
    ("criteria", "verdict"),
    [
        ([criterion(0.5)], "reproduced"),
        ([criterion(0.5), criterion(1.5)], "reproduced in part"),
        ([criterion(0.5), criterion(3.0)], "reproduced in part"),
        ([criterion(1.5)], "not reproduced"),
        ([criterion(1.9, 2.1)], "not reproduced"),
        ([criterion(1.5), criterion(3.0)], "not reproduced"),
        ([criterion(3.0)], "contradicted"),
        ([criterion(3.0, fails=None)], "not reproduced"),
        ([criterion(1.0)], "reproduced"),
        ([criterion(0.9, 1.1)], "inconclusive"),
        ([criterion(0.5), criterion(0.9, 1.1)], "inconclusive"),
    ],
)
def test_each_verdict_from_where_the_intervals_lie(criteria, verdict):
    assert Claim("it is small", "section 1", criteria).judge(made(0.1)).verdict == verdict
    assert verdict in VERDICTS


@pytest.mark.parametrize("sample", [[7.0], [math.inf]])
def test_a_value_without_a_limit_stands_beside_others_and_decides_nothing(sample):
    beside = Criterion("height", lambda results: sample, ANY)
    judged = Claim("it is small", "section 1", [criterion(1.5), beside]).judge(made(0.1))
    assert judged.verdict == "not reproduced"
    (row,) = evidence_of(judged)["height"]
    assert (row.limit, row.verdict) == ("", "")


@pytest.mark.parametrize(
    ("sample", "sentence"),
    [([5e-4], "It is 0.5 mm."), ([1.5e-3], "It is not: 1.5 mm."), ([9e-4, 1.1e-3], "Unclear: 1 mm.")],
)
def test_a_finding_has_a_sentence_for_each_outcome(sample, sentence):
    measured = Criterion("error", lambda results: sample, at_most(1e-3), unit="mm", scale=1e3)
    finding = Finding([measured], "It is {value}.", "It is not: {value}.", "Unclear: {value}.")
    assert finding.judge(made(0.1)).sentence == sentence


@pytest.mark.parametrize("wrong", ["{valeu}", "{values[1]}", "{values.first}", "{value", "{}"])
@pytest.mark.parametrize("outcome", ["yes", "no", "unclear"])
def test_a_wrong_name_in_braces_is_an_error_before_the_outcome_that_shows_it(wrong, outcome):
    sentences = {"yes": "{value}", "no": "{values[0]}", "unclear": "{{}}"}
    Finding([criterion(0.5)], **sentences)
    with pytest.raises(BadInput):
        Finding([criterion(0.5)], **{**sentences, outcome: wrong})


def test_a_finding_without_a_sentence_for_it_says_that_it_is_undecided():
    samples = [0.5], [1.5], [0.9, 1.1]
    sentences = {Finding([criterion(*sample)], "Yes.", "No.").judge(made(0.1)).sentence for sample in samples}
    assert sentences == {"Yes.", "No.", UNDECIDED.format("Yes.")}


def test_a_statement_without_criteria_is_an_error():
    with pytest.raises(BadInput):
        Finding([], "It is.", "It is not.", "Unclear.")
    with pytest.raises(BadInput):
        Claim("it is small", "section 1", [])


WIDE = [0.08] * 10 + [0.12] * 10 + [0.1] * 20


def test_evidence_names_a_quantity_once_with_its_cases_below():
    own = partial(Criterion, "error", holds=between(0.05, 0.2), fails=at_least(0.5), unit="%", scale=100.0)
    wide, infinite = own(lambda results: WIDE, case="leg"), own(lambda results: [math.inf], case="walk")
    judged = Claim("it is small", "section 1", [wide, infinite]).judge(made(0.1))
    (rows,) = evidence_of(judged).values()
    assert rows[0] == ("leg", "10 %", "", "9.5 to 10.5 %", "40", "5 to 20 %", "at least 50 %", "reproduced")
    assert format_text("It is small.", evidence_of(judged)).splitlines() == [
        "It is small.",
        "  error",
        "    leg   10 %      9.5 to 10.5 %  5 to 20 %  reproduced",
        "    walk  infinite  deterministic  5 to 20 %  contradicted",
        "      infinite: a run ended early",
    ]
    page = format_html(evidence_of(judged))
    assert (page.count("error"), page.count("<tr>"), page.count("\n\n")) == (1, 4, 0)
    assert "infinite (a run ended early)" in page


def test_the_table_has_a_row_a_run():
    results = made(0.1, float("nan"), machine="leg")
    assert results.table[["machine", "status", "cycles"]].values.tolist() == [
        ["leg", "completed", 5],
        ["leg", "fell", 2],
    ]


def test_a_crossed_table_has_a_row_for_each_value_of_one_setting_and_a_column_for_each_of_another():
    runs = [made(10.0 * delay + lead, delay=delay, lead=lead).rows[0] for delay in (0, 1) for lead in (1, 2)]
    table = cross_tabulate(Results(runs), ("delay", "late"), ("lead", "lead"), lambda own: last_error(own)[0])
    assert table.to_dict("list") == {"late": [0, 1], "lead 1": [1.0, 11.0], "lead 2": [2.0, 12.0]}


GROUPS = Results(
    [
        *made(0.001, walk="soft", law="a").rows,
        *made(0.009, walk="soft", law="b").rows,
        *made(0.002, math.nan, walk="hard", law="a").rows,
    ]
)


def end(results: Results) -> np.ndarray:
    return results.end("transfer_rmse_x", 1)


def test_a_table_has_a_row_for_each_combination_that_occurs():
    columns = {"completed": completed, **ends(["transfer_rmse_x"], 1)}
    table = tabulate(GROUPS, {"walk": "ground", "law": "law"}, columns)
    assert list(table.columns) == ["ground", "law", "completed", "x error, mm"]
    assert table.to_numpy().tolist() == [
        ["soft", "a", "1 of 1", pytest.approx(1.0)],
        ["soft", "b", "1 of 1", pytest.approx(9.0)],
        ["hard", "a", "1 of 2", pytest.approx(2.0)],
    ]


def test_bars_stand_at_the_names_of_their_groups():
    panel = over_setting(GROUPS, "walk", "error, m", end, by="law", kind="bars")
    first, second = panel.series
    assert panel.ticks == ["soft", "hard"]
    assert (first.name, first.x, second.x) == ("a", [0, 1], [0])
    assert first.y == pytest.approx([0.001, 0.002])  # of the runs that completed


def test_a_figure_over_cycles_is_logarithmic_where_values_span_decades():
    narrow, wide = (draw_cycles(runs, ["transfer_rmse_x"], "law") for runs in (made(0.5, law="a"), GROUPS))
    assert [figure.axes[0].get_yscale() for figure in (narrow, wide)] == ["linear", "log"]


def test_a_ratio_is_over_the_runs_selected():
    both = ratio(end, {"walk": "soft", "law": "b"}, {"walk": "soft", "law": "a"})
    assert both(GROUPS) == pytest.approx([9.0])


def test_a_share_is_of_the_runs_with_its_settings_and_shown_in_per_cent():
    share = percent("error", end, at_most(0.002), of={"walk": "soft"}, law=["a", "b"])
    assert Finding([share], "yes", "no").judge(GROUPS).measured[0].value == "0.3 %"


def test_runs_end_with_an_error_or_in_a_cycle():
    whole, some, none = made(0.25, 0.25), made(0.25, math.nan), made(math.nan)
    assert [describe_end(own, last_error(own)) for own in (whole, some, none)] == [
        "0.25",
        "ends in 3 (1 complete)",
        "ends in 3",
    ]


def test_a_ratio_is_that_of_the_same_seed_and_infinite_where_the_run_ended():
    own = Results([*made(2.0, seed=0).rows, *made(4.0, seed=1).rows])
    other = Results([*made(6.0, seed=1).rows, *made(1.0, seed=0).rows, *made(math.nan, seed=1).rows])
    ratios = relative(other, own, last_error)
    assert ratios.tolist() == pytest.approx([1.5, 0.5, math.inf])
    assert per_seed(other, ratios, min).tolist() == pytest.approx([1.5, 0.5])


def test_a_setting_that_is_a_word_in_some_runs_and_a_number_in_others_is_a_column_of_text():
    results = Results([*made(0.1, lead=1).rows, *made(0.1, lead="auto").rows])
    assert results.table["lead"].tolist() == ["1", "auto"]


def test_the_claims_begin_with_the_count_and_the_meaning_of_each_verdict(tmp_path):
    claims = [
        Claim(f"it is {i}", "section 1", [criterion(value)]).judge(made(0.1)) for i, value in enumerate((0.5, 0.5, 3))
    ]
    (part,) = make_claims_section(claims, tmp_path).parts
    summary, _, table = part.partition('<div class="claim"')
    assert "2 of 3 claims are reproduced, 1 contradicted." in summary
    assert all(part.count(meaning) == 1 and meaning in summary for meaning in VERDICTS.values())
    assert table.count("verdict reproduced") == 2 * 2  # of the claim and of its criterion


def test_a_claim_links_to_the_pages_of_its_runs_and_says_how_to_make_them(tmp_path):
    with_page, without = tmp_path / "runs" / "a", tmp_path / "runs" / "b"
    (with_page / "report").mkdir(parents=True)
    (with_page / "report" / "report.html").touch()
    measured = Measured(criterion(0.5), estimate([0.5]), [str(with_page), str(without)])
    (part,) = make_claims_section(
        [Judged(Claim("it", "1", [measured.criterion]), [measured])], tmp_path / "page"
    ).parts
    assert re.findall(r'href="([^#"]+)"', part) == ["../runs/a/report/report.html"]
    assert "python -m cmacexp.report FOLDER" in part
    assert str(tmp_path / "runs") in part


def test_a_digest_leaves_out_docstrings_and_nothing_else(tmp_path):
    def digest(text: str) -> str:
        path = tmp_path / "a.py"
        path.write_text(text)
        return digest_source(path)

    plain = digest("def f():\n    return 1\n")
    assert digest('"""About it."""\n\ndef f():\n    """Give\n    one."""\n    return 1\n') == plain
    assert digest("def f():\n    return 2\n") != plain
    assert digest('def f(x=1): "text"\n') != digest('def f(x=2): "text"\n')  # code stands on the line too
