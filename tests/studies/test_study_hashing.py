"""The study of hashing: what it says follows the data, and its quick form leaves a whole report."""

import json
from math import inf, nan

import pytest
from pipelines.analysis.hashing_found import Memory, enough, interval, worse
from pipelines.analysis.hashing_words import advice, claim, table
from support.command import ROOT, python

from cmacexp.data.integrity import faults
from pipelines.analysis.cmac_size_verdicts import Size

CELLS = 1600


def memory(size: int, *y: float | None, rate: float = 0.5, visited: bool = False) -> Memory:
    """With such an error in y in the last ten of 20 cycles for each seed, mm, and a tenth in x; None: it ended."""
    sizes = []
    for error in y:
        late = {} if error is None else dict.fromkeys(range(11, 21), error)
        x, own = ({1: 40.0, 3: 9.0, **{k: part * v for k, v in late.items()}} for part in (0.1, 1.0))
        rows = size // 16
        sizes.append(Size({}, x, own, 0.05, 0.9, nan, 0.16, 32, size, rows, CELLS, CELLS, round(rate * CELLS)))
    return Memory(sizes, 20, visited)


FREE = memory(2**20, 0.5, rate=0.0, visited=True)


def test_an_interval_is_that_of_the_logarithms():
    low, middle, high = interval([1.0, 2.0, 4.0])
    assert middle == pytest.approx(2.0)
    assert high / middle == pytest.approx(middle / low) == pytest.approx(5.594, abs=2e-3)  # 4.303 ln 2 / sqrt 3
    assert interval([3.0]) == pytest.approx((3.0, 3.0, 3.0))
    assert str(interval([])) == "-"


def test_a_memory_that_ends_a_run_is_worse_than_any():
    assert worse(memory(1024, 0.6, None), [FREE]) == inf
    assert worse(memory(1024, 5.0), [FREE]) > 1.0


def test_what_is_learnt_is_counted_in_cycles_after_the_first():
    assert memory(1024, 3.9).learnt().middle == pytest.approx(10.0)
    assert str(memory(1024, 4.1).learnt()) == "-"
    assert str(memory(1024, 3.9, 4.1).learnt()) == "-"  # not of those alone that get there


def test_enough_is_the_smallest_memory_from_which_on_all_are_good():
    crowd = [memory(512, 1.0), memory(1024, 9.0), memory(2048, 1.0), memory(4096, 1.0), FREE]
    found = enough(crowd, lambda one: one.errors("y").middle < 2.0)
    assert found is not None
    assert found.memory == 2048
    assert enough(crowd, lambda one: False) is None


def told(*memories: Memory) -> str:
    return " ".join(text.text for text in advice({"the rule": [*memories, FREE]}))


def test_advice_follows_the_data():
    learns = told(memory(512, 40.0, 40.0, rate=1.0), memory(2**20, 0.5))
    assert "even 64 words, where 100% collide, complete every run" in learns
    assert "hash with 41 rows for each visited cell, or give" in learns
    assert "below 131072 words" not in learns
    ends = told(memory(512, None, 9.0), memory(1024, 5.0), memory(2**20, 0.5))
    assert "below 128 words some runs diverge or fall" in ends
    none = told(memory(512, 40.0), memory(2**20, 40.0))
    assert "no hashed memory comes within 1.25 times" in none
    assert "on a planned path give every visited cell" in none


class NoRuns(dict):
    """Instead of runs that a claim links to."""

    def links(self, *names):
        return []


@pytest.mark.parametrize(
    ("memories", "verdict"),
    [
        ([memory(512, 0.55)], "reproduced"),
        ([memory(512, 5.0), memory(1024, 0.55)], "reproduced in part"),
        ([memory(512, None)], "contradicted"),
    ],
)
def test_robustness_is_judged_where_most_cells_collide(memories, verdict):
    assert claim({"the rule": [*memories, memory(2**20, 9.0, rate=0.1), FREE]}, NoRuns(), []).verdict == verdict


def test_the_table_has_every_memory():
    rows = table({"the rule": [memory(512, 1.0, 1.0), FREE]}).rows
    assert [row[1] for row in rows] == ["64", f"{CELLS * 2}, no collision"]
    assert rows[0][-1] == "0 of 2"


def test_quick_study_leaves_a_whole_report(tmp_path):
    done = python("-m", "pipelines.hashing", "--quick", "--folder", str(tmp_path), folder=ROOT)
    assert done.returncode == 0, done.stderr
    report = tmp_path / "hashing-quick"
    assert not faults(report)
    page = (report / "report.html").read_text()
    assert page.count("Advice: on a planned path") == 2
    assert json.loads((report / "manifest.json").read_text())["status"] == "completed"
