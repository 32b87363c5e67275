"""Every value that is shown for several legs is pooled as the registry says, wherever it is shown."""

import math
import re
import statistics

import numpy as np
import pytest
from support.command import cmacexp
from support.manifests import accept

from cmacexp.data.parquet import as_array
from cmacexp.data.tables import Scores, write_scores
from cmacexp.experiment.api import load
from cmacexp.experiment.objective import MINIMIZE, read_objective
from cmacexp.metrics.body import BODY_METRICS
from cmacexp.metrics.metric import (
    CYCLE,
    LARGE,
    LARGEST,
    LEG,
    MEAN,
    NEAR_ZERO,
    RMS,
    SMALL,
    SMALLEST,
    to_table,
)
from cmacexp.metrics.pooling import pool_legs, tabulate_cycles
from cmacexp.metrics.registry import ALL_METRICS, JUDGED, MAIN, METRICS
from cmacexp.metrics.text import format_cell
from cmacexp.metrics.tracking import SPATIAL
from cmacexp.report.run_figures import draw_metrics
from cmacexp.report.run_report import make_run_report
from cmacexp.report.run_summary import format_runs, make_rows, read_summary

BY_NAME = {
    "mean": statistics.fmean,
    "RMS": lambda values: math.sqrt(statistics.fmean(value**2 for value in values)),
    "largest": max,
    "smallest": min,
    "": statistics.fmean,
}


def expected(scores):
    """Pooled by the names in the registry, worked out without its functions."""
    found = {}
    for name in [*scores.legs.column_names[2:], *scores.body.column_names[1:]]:
        metric = ALL_METRICS[name]
        table = scores.body if name in BODY_METRICS else scores.legs
        rows = as_array(table, name).reshape(2, -1).tolist()
        known = [[value for value in row if not math.isnan(value)] for row in rows]
        found[name] = [BY_NAME[metric.pooling.name](row) if row else math.nan for row in known]
    return found


@pytest.fixture(scope="module", params=[METRICS, {**METRICS, **SPATIAL}], ids=["plane", "space"])
def walk(request, tmp_path_factory):
    """A walk of two cycles whose metrics are replaced by ones that tell every pooling from every other."""
    folder = tmp_path_factory.mktemp("pooling") / "walk"
    cmacexp("scenario=quadruped", "cycles=2", "record=trace", f"hydra.run.dir={folder}", folder=folder.parent)
    rng = np.random.default_rng(3)
    legs = {name: rng.normal(0.5, 2.0, (2, 4)) for name in request.param}
    for index, values in enumerate(legs.values()):
        values[index % 2, index % 4] = math.nan
    legs["force_iae"][:] = math.nan
    cycle, leg = np.repeat([1, 2], 4), np.tile([1, 2, 3, 4], 2)
    body = {name: rng.normal(0.5, 2.0, 2) for name in BODY_METRICS}
    scores = Scores(
        to_table({"cycle": (CYCLE, cycle), "leg": (LEG, leg)}, legs, request.param),
        to_table({"cycle": (CYCLE, np.array([1, 2]))}, body, BODY_METRICS),
    )
    accept(folder, *write_scores(folder, scores))
    return load(folder), expected(scores)


def select_shown(values, shown=MAIN):
    """The metrics that are shown of several legs, of a robot without those that the distance replaces."""
    replaced = [f"transfer_rmse_{axis}" for axis in "xyz"] if "transfer_rmse" in values else []
    return {name: s for name, s in shown.items() if s.over_legs and name in values and name not in replaced}


def test_the_pools_follow_their_names(walk):
    run, values = walk
    pooled = pool_legs(run.scores)
    assert list(pooled) == list(values)
    for name in values:
        np.testing.assert_allclose(pooled[name], values[name], rtol=1e-14, err_msg=name)
    assert np.isnan(pooled["force_iae"]).all()


def test_terminal_and_notebook_show_the_pooled_values(walk):
    run, values = walk
    main, rows = tabulate_cycles(run.scores)
    assert main == select_shown(values)
    for cycle, row in enumerate(rows):
        numbers = [format_cell(values[name][cycle] * shown.factor) for name, shown in main.items()]
        assert row == [str(cycle + 1), *numbers]
        assert "  ".join(row[1:2]) in repr(run)


def test_the_report_of_a_run_shows_the_pooled_values(walk):
    run, values = walk
    report = make_run_report(run)
    parts = {section.title: section.parts for section in report.sections}
    (key,) = parts["In short"]
    shown = {ALL_METRICS[name].meaning: (name, main) for name, main in select_shown(values).items()}
    assert len(key.rows) == len(shown)
    for title, meaning, unit, *numbers in key.rows:
        name, main = shown[meaning]
        name_and_symbol = re.sub("</?(i|sub)>", "", title.replace("<sub>", "_").replace("_</sub>", ""))
        assert (name_and_symbol, unit) == (f"{main.title} {main.symbol}", main.unit)
        assert numbers == [format_cell(main.factor * value) for value in values[name]]


def test_the_figure_of_a_run_draws_the_pooled_values(walk):
    run, values = walk
    panels = draw_metrics(run).figure.axes
    for axes, (name, shown) in zip(panels, select_shown(values).items(), strict=True):
        np.testing.assert_allclose(axes.lines[0].get_ydata(), shown.factor * np.array(values[name]), err_msg=name)
        assert len(axes.lines) == (1 if name in BODY_METRICS else 5)


def test_sweep_table_and_objective_take_the_pooled_values(walk):
    run, values = walk
    summary = read_summary(run.folder)
    (row,) = make_rows([summary], [])
    for name in values:
        np.testing.assert_allclose(row[f"final_{name}"], values[name][1], rtol=1e-14, err_msg=name)
        metric, final = ALL_METRICS[name], values[name][1]
        sought = abs(final) if metric.better == NEAR_ZERO else final
        if not math.isnan(sought):
            assert read_objective(name, summary, MINIMIZE) == pytest.approx(sought, rel=1e-14)
    sought = {SMALL: min, LARGE: max, NEAR_ZERO: lambda values: min(values, key=abs)}
    for name in JUDGED.keys() & values.keys():
        known = [value for value in values[name] if value == value]
        assert row[f"best_{name}"] == pytest.approx(sought[ALL_METRICS[name].better](known), rel=1e-14)
    titles, ((*_, status, cycles, first, _, _, _, share, _, _, _),) = format_runs([summary], [])
    assert titles[3:] == [f"{shown.title}\n{shown.unit}" for shown in select_shown(values).values()]
    error = next(iter(select_shown(values)))
    assert (status, cycles, first) == ("completed", "2", format_cell(1e3 * values[error][1]))
    assert share == format_cell(100.0 * values["feedforward_share"][1])


def test_poolings_and_directions_of_families():
    for name, metric in ALL_METRICS.items():
        if name.endswith("_time"):
            assert (metric.pooling, metric.better) == (LARGEST, SMALL)
        elif "_rmse" in name or name.endswith(("_rms", "_ripple", "_change")):
            assert metric.pooling == RMS
        elif name.endswith(("_iae", "_itae")):
            assert (metric.pooling, metric.better) == (MEAN, SMALL)
        elif name.endswith("_peak"):
            assert metric.pooling == LARGEST
    assert METRICS["drift_cycle"].pooling == SMALLEST
    assert {name for name, metric in BODY_METRICS.items() if "margin" in name} == {
        name for name, metric in BODY_METRICS.items() if metric.better == LARGE
    }
