"""The study of sensors: its cases, what it counts as felt, its intervals, and that it runs from the command line."""

import json
from math import inf, isnan, nan

import pandas as pd
import pytest
from support.command import python

from pipelines.analysis.sensor_failures import KINDS, cases
from pipelines.analysis.sensor_noise import felt_from
from pipelines.shared.stats import spread


def test_the_forty_cases_take_in_every_kind_on_every_leg_twice():
    counted = pd.Series([(case.kind, case.leg) for case in cases()]).value_counts()
    assert len(cases()) == 40
    assert set(counted) == {2}
    assert len(counted) == len(KINDS) * 4
    assert cases() == cases()
    assert len({case.start for case in cases()}) == 40


def test_an_interval_is_students():
    known = spread([9.0, 10.0, 11.0, 10.0])  # deviation 0.8165, Student 3.182 of three degrees of freedom
    assert known.mean == 10.0
    assert known.half == pytest.approx(3.182 * 0.8165 / 2.0, rel=1e-3)
    assert isnan(spread([1.0]).half)
    assert isnan(spread([]).mean)


def noise_rows(*levels, fails=None):
    rows = [{"signal": "sound", "level": 0.0, "well": 2, "of": 2, "y": spread([1.0, 1.0])}]
    rows += [
        {"signal": "force", "level": level, "well": 1 if level == fails else 2, "of": 2, "y": spread([y, y])}
        for level, y in levels
    ]
    return pd.DataFrame(rows)


@pytest.mark.parametrize(
    ("rows", "level"),
    [
        (noise_rows((0.1, 1.4), (0.2, 1.6), (0.4, 9.0)), 0.2),
        (noise_rows((0.1, 1.0), (0.2, 1.0)), inf),
        (noise_rows((0.1, 1.0), (0.2, 1.0), fails=0.1), 0.1),
        (noise_rows((0.1, nan), (0.2, 1.5)), 0.2),
    ],
)
def test_noise_is_felt_from_the_least_level_that_harms(rows, level):
    assert felt_from(rows, "force", "y") == level


def test_the_quick_study_leaves_a_report_that_ends_every_section_in_advice(tmp_path):
    done = python("-m", "pipelines.sensors", "--quick", "--folder", str(tmp_path), folder=tmp_path)
    assert done.returncode == 0, done.stderr
    report = tmp_path / "sensors-quick"
    assert "Advice:" in (report / "report.html").read_text()
    assert {path.stem for path in (report / "figures").glob("*.png")} >= {"failures", "failure", "noise_leg", "delay"}
    assert json.loads((report / "manifest.json").read_text())["files"]
