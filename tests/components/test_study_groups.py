"""What studies share: rows and bars of groups, ratios of selections, shares of runs that ended before."""

from pathlib import Path

import numpy as np
import pytest

from cmacexp.report.run_summary import RunSummary
from cmacexp.study import Finding, at_most
from cmacexp.study.curves import draw_cycles, over_setting
from cmacexp.study.results import Results, Row
from cmacexp.study.samples import over_history, ratio
from cmacexp.study.statements import UNDECIDED, percent
from cmacexp.study.tables import completed, ends, tabulate


def run(error: float, status: str = "completed", **settings) -> Row:
    """Of four cycles, with an error that falls to ``error``."""
    metrics = {"transfer_rmse_x": np.array([8.0, 4.0, 2.0, 1.0]) * error}
    return Row(RunSummary(Path("run"), status, "", {}, 4, metrics), settings, settings, {})


RUNS = Results(
    [
        run(0.001, walk="soft", law="a"),
        run(0.009, walk="soft", law="b"),
        run(0.002, walk="hard", law="a"),
        run(0.009, "fell", walk="hard", law="a"),
    ]
)


def end(results: Results) -> np.ndarray:
    return results.end("transfer_rmse_x", 1)


def test_a_table_has_a_row_for_each_combination_that_occurs():
    table = tabulate(RUNS, {"walk": "ground", "law": "law"}, {"completed": completed, **ends(["transfer_rmse_x"], 1)})
    assert list(table.columns) == ["ground", "law", "completed", "transfer x, mm"]
    assert table.to_numpy().tolist() == [
        ["soft", "a", "1 of 1", pytest.approx(1.0)],
        ["soft", "b", "1 of 1", pytest.approx(9.0)],
        ["hard", "a", "1 of 2", np.inf],
    ]


def test_bars_stand_at_the_names_of_their_groups_and_an_infinite_one_is_missing():
    panel = over_setting(RUNS, "walk", "error, m", end, by="law", kind="bars")
    first, second = panel.series
    assert panel.ticks == ["soft", "hard"]
    assert (first.name, first.x, second.x) == ("a", [0, 1], [0])
    assert first.y == pytest.approx([0.001, np.nan], nan_ok=True)


def test_a_figure_over_cycles_is_logarithmic_where_values_span_decades():
    narrow, wide = (draw_cycles(runs, ["transfer_rmse_x"], "law") for runs in (RUNS.select(law="a"), RUNS))
    assert [figure.axes[0].get_yscale() for figure in (narrow, wide)] == ["linear", "log"]


def test_a_ratio_is_over_the_runs_selected_and_a_run_that_ended_is_infinite():
    both = ratio(end, {"walk": "soft", "law": "b"}, {"walk": "soft", "law": "a"})
    assert both(RUNS) == pytest.approx([9.0])
    least = over_history("transfer_rmse_x", lambda errors: float(errors.min()))
    assert least(RUNS.select(walk="hard")) == pytest.approx([0.002, np.inf])


def test_an_undecided_finding_needs_no_sentence_and_a_share_is_shown_in_per_cent():
    spread = percent("error", lambda results: end(results), at_most(0.002), of={"walk": "soft"}, law=["a", "b"])
    found = Finding([spread], "yes", "no").judge(RUNS)
    assert (found.sentence, found.measured[0].value) == (UNDECIDED, "0.5 %")
