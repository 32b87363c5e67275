"""The studies of CMAC sizes and of assumed values: verdicts follow the data, and both run from the command line."""

import ast
import json
from dataclasses import replace
from itertools import pairwise
from math import inf, nan
from types import SimpleNamespace

import pandas as pd
import pytest
from support.command import ROOT, python

from cmacexp.data.integrity import faults
from pipelines import assumptions, cmac_size
from pipelines.analysis.assumptions_conclusions import (
    Conclusion,
    Outcome,
    changed_by,
    cycle_of,
    matters,
    one_leg,
    quadruped,
)
from pipelines.analysis.assumptions_list import METHODS, ONE_LEG, QUADRUPED
from pipelines.analysis.cmac_size_verdicts import (
    MEMORY,
    Size,
    enough_memory,
    enough_room,
    verdict_of_little,
    verdict_of_rate,
    verdict_of_robustness,
)
from pipelines.analysis.measured import changed, short, size_of

PAPER = Size(
    changed={},
    x={1: 10.0, 5: 1.0},
    y={1: 40.0, 5: 10.0},
    force_error=0.05,
    share=0.9,
    tilt=nan,
    width=0.16,
    layers=32,
    memory=2**20,
    rows=2**16,
    rows_used=1500,
    cells=1600,
    colliding=32,
)


def smaller(memory: int, colliding: int, x: float, y: float = 10.0, **more) -> Size:
    """The paper's size with less memory, and its errors in cycle 5, mm."""
    rows = {"memory": memory, "rows": memory // 16, "colliding": colliding}
    return replace(PAPER, changed={MEMORY: memory, **more}, x={1: 10.0, 5: x}, y={1: 40.0, 5: y}, **rows)


def test_rate_of_collision_at_the_papers_size_decides_then_that_of_any():
    many = replace(PAPER, colliding=80)
    assert verdict_of_rate([PAPER]) == "reproduced"
    assert verdict_of_rate([many]) == "not reproduced"
    assert verdict_of_rate([many, smaller(2**22, 10, 1.0)]) == "reproduced in part"


def test_robustness_is_judged_where_most_cells_collide():
    assert verdict_of_robustness([PAPER, smaller(2**14, 1200, 1.9)]) == "reproduced"
    assert (
        verdict_of_robustness([PAPER, smaller(2**14, 1200, 1.9), smaller(2**10, 1600, 2.1)]) == "reproduced in part"
    )
    assert verdict_of_robustness([PAPER, smaller(2**14, 1200, 2.1)]) == "not reproduced"
    assert verdict_of_robustness([PAPER, smaller(2**14, 1200, 2.6)]) == "contradicted"
    assert verdict_of_robustness([PAPER, smaller(2**14, 700, 9.0)]) == "not reproduced"


def test_robustness_takes_the_median_over_seeds():
    unlucky = [smaller(2**14, 1200, x, seed=k) for k, x in enumerate((1.1, 1.2, 9.0))]
    assert verdict_of_robustness([PAPER, *unlucky]) == "reproduced"
    assert verdict_of_robustness([PAPER, *unlucky, smaller(2**14, 1200, 9.0, seed=4)]) != "reproduced"


def test_enough_memory_ends_at_the_first_that_is_worse():
    sizes = [PAPER, smaller(2**18, 50, 1.0), smaller(2**16, 90, 2.5), smaller(2**14, 1200, 1.0)]
    assert enough_memory(sizes) == 2**18
    assert verdict_of_little(sizes) == "reproduced in part"
    assert verdict_of_little([PAPER, smaller(2**16, 50, 1.0)]) == "reproduced"
    assert verdict_of_little([PAPER, smaller(2**16, 50, 1.0, y=20.1)]) == "not reproduced"
    assert enough_room(sizes) == 2**14 / 1600


def test_a_run_that_ended_early_is_never_as_good():
    fallen = replace(smaller(2**14, 1200, 1.0), x={1: 10.0}, y={1: 40.0})
    assert enough_memory([PAPER, fallen]) == PAPER.memory


def run_of(x: list[float], status: str = "completed", **columns: list[float]) -> SimpleNamespace:
    """A run of one leg with these transfer errors in x by cycle."""
    count = len(x)
    given = {"cycle": range(1, count + 1), "leg": 1, "transfer_rmse_x": x, "transfer_rmse_y": x}
    rest = {"force_settled": 1.35, "force_steady_state_error": 0.049, "feedforward_share": 0.9}
    metrics = pd.DataFrame({**given, **rest, "force_rmse": 0.1, "force_rmse_three_feet": nan, **columns})
    body = pd.DataFrame({"cycle": range(1, count + 1), "tilt_max": x})
    return SimpleNamespace(metrics=metrics, body_metrics=body, walks=True, status=status, config={"cycles": 5})


def held(conclusions, run) -> list[bool]:
    return [c.holds(c.measure(run)) for c in conclusions]


def test_conclusions_of_one_leg_flip_with_the_data():
    learnt = [8.0, 6.0, 4.0, 3.0, 2.0]
    assert held(one_leg(), run_of(learnt)) == [True, True, True, True, False]
    assert held(one_leg(), run_of([*learnt[:4], 2.1]))[:2] == [False, False]
    assert held(one_leg(), run_of(learnt, force_steady_state_error=-0.051))[2] is False
    assert held(one_leg(), run_of(learnt, feedforward_share=0.4))[3] is False
    assert held(one_leg(), run_of(learnt, force_settled=0.95))[4] is True


def test_nothing_is_concluded_of_a_quadruped_that_falls():
    assert held(quadruped(), run_of([8.0, 1.0, 1.0], "fell")) == [False] * 6
    walking = run_of([8.0, 6.0, 4.0, 3.0, 2.0], force_rmse_three_feet=[4.0, 3.0, 2.0, 1.0, 1.0])
    assert held(quadruped(), walking) == [True] * 6


def test_errors_are_gone_from_the_cycle_on_from_which_they_stay_small():
    names = ["transfer_rmse_x", "transfer_rmse_y"]
    assert cycle_of(run_of([8.0, 2.0, 3.0, 2.0, 1.0]), names) == 4
    assert cycle_of(run_of([8.0, 2.0, 1.0, 1.0, 3.0]), names) != cycle_of(run_of([8.0, 2.0, 1.0, 1.0, 1.0]), names)


def test_an_assumption_matters_if_one_of_its_values_changes_a_conclusion():
    conclusions = (Conclusion("small", "error", "mm", lambda run: nan, most=1.0), Conclusion("a", "b", "c", float))
    taken = Outcome("values taken", "", "", (0.5, 0.0))
    tried = [Outcome(name, "0", "1", (error, 0.0)) for name, error in (("stroke", 0.9), ("lift", 0.9), ("lift", 1.1))]
    changing, harmless = matters(tried, taken.numbers, conclusions)
    assert list(changing) == ["lift"]
    assert harmless == ["stroke"]
    assert changed_by(Outcome("", "", "", (nan, inf)), taken.numbers, conclusions) == [0]
    assert any("1 can change" in text for text in assumptions.verdict(taken, tried, conclusions))
    assert any("0 can change" in text for text in assumptions.verdict(taken, tried[:2], conclusions))


def test_every_field_that_is_marked_assumed_is_tried():
    sources = [path.read_text() for path in sorted((ROOT / "cmacexp").rglob("*.py"))]
    bodies = [node.body for text in sources for node in ast.walk(ast.parse(text)) if isinstance(node, ast.ClassDef)]
    marked = {
        field.target.id
        for body in bodies
        for field, told in pairwise(body)
        if isinstance(field, ast.AnnAssign) and isinstance(told, ast.Expr) and "(assumed" in told.value.value
    }
    tried = {key.rsplit(".", 1)[-1] for a in (*ONE_LEG, *QUADRUPED, *METHODS) for key in a.keys}
    assert len(marked) >= 8
    assert marked <= tried


def test_no_assumption_is_tried_with_the_value_that_is_taken(make_config):
    from cmacexp.config import to_plain

    for assumed, overrides in assumptions.MACHINES.values():
        base = to_plain(make_config(*overrides))
        for one in assumed:
            for value in one.values:
                assert changed(to_plain(make_config(*overrides, *one.overrides(value))), base), (one.name, value)


def test_no_two_sizes_are_the_same():
    jobs = cmac_size.jobs(False)
    assert len({tuple(sorted(overrides)) for overrides in jobs.values()}) == len(jobs)


def test_values_in_words():
    assert (short(["angle"]), short(None), short(0.3), short(2097152)) == ("[angle]", "null", "0.3", "2097152")
    assert (size_of(512), size_of(16384), size_of(2**20)) == ("512 B", "16 KB", "1 MB")


@pytest.mark.parametrize(("name", "figures"), [("cmac_size", 3), ("assumptions", 2)])
def test_quick_form_leaves_a_report_with_its_figures(name, figures, tmp_path):
    done = python("-m", f"pipelines.{name}", "--quick", "--folder", str(tmp_path), folder=ROOT)
    assert done.returncode == 0, done.stderr
    folder = tmp_path / f"{name}-quick"
    assert "</html>" in (folder / "report.html").read_text()
    for kind in ("png", "svg"):
        assert len(list((folder / "figures").glob(f"*.{kind}"))) == figures
    assert not faults(folder)
    listed = json.loads((folder / "manifest.json").read_text())["files"]
    assert sum(path.endswith("metrics.parquet") for path in listed) >= len(list((tmp_path / "runs").iterdir()))
