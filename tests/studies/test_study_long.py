"""The study of long learning: its words follow its runs, and it runs from the command line."""

import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from support.command import ROOT, python

from cmacexp.cmac.rules import RULES
from cmacexp.data.integrity import faults
from pipelines import long_learning
from pipelines.analysis import long_learning_words as words
from pipelines.analysis.long_learning_runs import Long, best, final

ERRORS = np.array([10.0, 2.0, 1.0, 0.5, 0.5])
LASTING = Long(
    rule="paper",
    lead="1",
    delay=0,
    seed=0,
    config={},
    status="completed",
    asked=5,
    x=0.6 * ERRORS,
    y=0.8 * ERRORS,
    force=ERRORS,
    share=np.full(5, 0.97),
    steady=0.001,
    tilt=None,
    change=np.array([1.0, 0.5, 0.2, 0.1]),
    drift=None,
)
DRIFT = {"cycle": 3, "leg": 1, "named": 4, "growth": 1.02}
ENDING = replace(LASTING, lead="0", status="diverged", asked=9, drift=DRIFT)


def test_every_rule_is_run_with_every_lead_on_both_machines_for_as_long_as_is_asked():
    jobs = long_learning.jobs(quick=False)
    for machine, cycles in (("one leg", 10_000), ("quadruped", 500)):
        for rule in RULES:
            for lead in range(-2, 4):
                job = jobs[f"{machine} {rule} {lead}"]
                assert {f"cycles={cycles}", f"learning.rule={rule}", f"learning.lead={lead}"} <= set(job)
    for delay in (0, 1, 2):
        assert f"actuator.delay={delay}" in jobs[f"late actuator paper {delay} auto"]


def test_an_error_is_that_of_both_directions_and_ends_where_the_run_did():
    assert LASTING.error == pytest.approx(ERRORS)
    assert final(LASTING.error) == pytest.approx(1.0)  # the median of them all, of so few cycles
    assert best(LASTING.error) == (pytest.approx(0.5), 4)


def test_the_table_tells_what_lasts_and_when_the_rest_ended():
    rows = words.table([LASTING, ENDING]).rows
    assert rows[0][-2:] == ["lasts", "-"]
    assert rows[1][-2:] == ["diverged in 6", "3, 4"]


def test_advice_names_what_ends_with_the_least_error():
    worse = replace(LASTING, rule="leakage", x=2 * LASTING.x, y=2 * LASTING.y)
    told = " ".join(part.text for part in words.advice_leg([worse, LASTING, ENDING], LASTING))
    assert "The law as published diverged in cycle 6" in told
    assert "take paper with lead 1" in told
    assert "leakage with lead 1" in told


def test_advice_on_drift_counts_what_was_named_and_what_was_not():
    told = words.advice_drift([LASTING, ENDING, replace(ENDING, drift=None)]).text
    assert "Drift was detected in 1 of the 2 runs that diverged or fell, 2 cycles before" in told
    assert "Of the 1 runs that completed, 1 showed none; they end at 2.00 times their best error" in told
    assert "the 0 others at - times" in told


def test_predictions_are_counted_by_whether_they_are_near_and_on_the_right_side():
    growth = pd.DataFrame(
        {
            "machine": "one leg",
            "rule": "paper",
            "lead": ["0", "1", "2", "3"],
            "predicted": [1.02, 0.98, 1.05, np.nan],
            "measured": [1.025, 0.985, 0.99, 1.1],
        }
    )
    assert "2 of 3 predictions" in words.of_growth(growth)
    told = words.advice_growth(growth).text
    assert "correctly in 2 of 3 cases" in told
    assert "as published 1.0200 predicted, 1.0250 measured" in told


def test_advice_on_late_actuators_lists_the_leads_that_last():
    runs = [replace(LASTING, delay=1, lead="auto"), replace(ENDING, delay=1, lead="1")]
    assert "1 late: auto last." in words.advice_late(runs).text


def test_the_advised_rate_is_the_fastest_that_lasts():
    runs = {
        "0.1, lead 1": LASTING,
        "0.2, lead 1": replace(LASTING, x=np.full(5, 0.1), y=np.full(5, 0.1)),
        "9": ENDING,
    }
    told = words.advice_rate(runs).text
    assert "rate 0.2, lead 1 is at 1 mm first, in cycle 1." in told
    assert "Drift at 9" in told


def test_the_study_runs_and_every_section_ends_in_advice(tmp_path):
    done = python("-m", "pipelines.long_learning", "--quick", "--folder", str(tmp_path), folder=ROOT)
    assert done.returncode == 0, done.stderr
    folder = tmp_path / "long_learning-quick"
    assert faults(folder) == []
    page = re.sub(r'src="data:[^"]*"', "", (folder / "report.html").read_text())
    sections = page.split("<section")[1:]
    assert sum("Advice:" in section for section in sections) == 8
    growth = pd.read_parquet(folder / "growth.parquet")
    leg = growth[(growth["machine"] == "one leg") & (growth["rule"] == "paper")]
    assert (leg["predicted"] - leg["measured"]).abs().max() < 0.01
