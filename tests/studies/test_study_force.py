"""The study of force control methods: verdicts follow the data, and the command leaves a report."""

import csv
import time
from concurrent.futures import ThreadPoolExecutor

import pandas as pd
import pytest
from support.command import python

from cmacexp.config.compose import compose_config
from cmacexp.data.integrity import is_finished
from cmacexp.experiment import run_scenario
from pipelines.analysis.stiffness_mismatch import apparent_stiffness, predicted_force
from pipelines.force_methods import best_claim, elasticity_claim, method_claim, settles
from pipelines.shared import runs

CONFIG = {
    "controller": {"position_gain": 100.0, "velocity_gain": 5.0},
    "force_control": {"force_gain": 100.0, "elasticity": 0.1, "admittance": 0.1},
}


def row(settled=1.0, ripple=0.0, overshoot=0.1, itae=0.01, status="completed"):
    return {
        "force_settled": settled,
        "force_ripple": ripple,
        "force_overshoot": overshoot,
        "force_itae": itae,
        "status": status,
    }


def rows(**by_name):
    return pd.DataFrame(by_name.values(), index=list(by_name))


@pytest.mark.parametrize(
    ("values", "rests"),
    [
        ({}, True),
        ({"settled": 1.02}, False),
        ({"settled": 0.98}, False),
        ({"ripple": 0.5}, False),
        ({"settled": float("nan")}, False),
        ({"status": "diverged"}, False),
    ],
)
def test_what_counts_as_settled(values, rests):
    assert settles(pd.Series(row(**values)), 1.0) == rests


def test_a_method_is_judged_by_all_its_runs():
    assert method_claim("m", "eq. 9", rows(m=row()), 1.0, []).verdict == "reproduced"
    assert method_claim("m", "eq. 9", rows(m=row(ripple=1.0), heavy=row()), 1.0, []).verdict == "reproduced in part"
    claim = method_claim("m", "eq. 9", rows(m=row(settled=1.3)), 1.0, [])
    assert claim.verdict == "not reproduced"
    assert "1.300 N" in claim.measured


def test_combined_is_best_only_if_it_is():
    others = {"stiffness": row(overshoot=0.75, itae=0.007), "damping": row(overshoot=0.11, itae=0.2)}
    wild = row(ripple=1.0, overshoot=0.0, itae=0.0)
    assert (
        best_claim(rows(**others, combined=row(0.999, 0, 0.08, 0.006), explicit=wild), 1.0, []).verdict
        == "reproduced"
    )
    assert best_claim(rows(**others, combined=row(1, 0, 0.08, 0.008)), 1.0, []).verdict == "reproduced in part"
    assert best_claim(rows(**others, combined=row(1, 0, 0.9, 0.9)), 1.0, []).verdict == "not reproduced"


def test_a_smaller_elasticity_is_stiffer_only_if_it_is():
    assert elasticity_claim({0.0: 100.0, 0.1: 9.0, 0.01: 50.0}, []).verdict == "reproduced"
    assert elasticity_claim({0.0: 9.0, 0.1: 100.0}, []).verdict == "contradicted"


def test_predicted_force_by_hand():
    """Eq. 8: F = K_a K_n D_r / (K_n + K_a + K_a K_n P_fn), with D_r made for 10 N/m."""
    depression = 1 / 10 + 1 / 100 + 0.1
    by_hand = 100 * 20 * depression / (20 + 100 + 100 * 20 * 0.1)
    assert predicted_force("stiffness", CONFIG, 10.0, 2.0) == pytest.approx(by_hand)
    assert predicted_force("combined", CONFIG, 10.0, 1.0) == 1.0
    assert predicted_force("damping", CONFIG, 10.0, 2.0) == predicted_force("explicit", CONFIG, 10.0, 4.0) == 1.0


def test_apparent_stiffness_by_hand():
    def at_rest(force, depth):
        return pd.DataFrame({"force": [0.0, force], "y": [0.45, depth]})

    assert apparent_stiffness(at_rest(1.0, 0.6), at_rest(1.09, 0.591)) == pytest.approx(10.0)


def test_studies_that_need_the_same_run_at_the_same_time_run_it_once(tmp_path, monkeypatch):
    begun = []

    def counted(config, folder):
        begun.append(folder)
        time.sleep(0.2)  # the other one comes while this one runs
        return run_scenario(config, folder)

    monkeypatch.setattr("cmacexp.experiment.run_scenario", counted)
    config = compose_config(["scenario=force_step", "record=trace"])
    with ThreadPoolExecutor(2) as pool:
        for done in [pool.submit(runs._run, tmp_path / "run", config) for _ in range(2)]:
            done.result()
    assert begun == [tmp_path / "run"]
    assert is_finished(tmp_path / "run", config)


def test_a_file_in_the_place_of_the_folder_is_refused_before_anything_runs(tmp_path):
    (tmp_path / "taken").touch()
    done = python("-m", "pipelines.force_methods", "--quick", "--folder", "taken", folder=tmp_path)
    assert done.returncode == 2
    assert done.stderr == "error: --folder=taken: taken is a file; choose a folder, it is made if missing\n"


def test_the_command_leaves_a_report(tmp_path):
    done = python("-m", "pipelines.force_methods", "--quick", "--folder", str(tmp_path), folder=tmp_path)
    assert done.returncode == 0, done.stderr
    folder = tmp_path / "force_methods-quick"
    assert done.stdout.splitlines()[-1] == str(folder / "report.html")
    with (folder / "claims.csv").open() as file:
        verdicts = {line["claim"].split(" ")[0]: line["verdict"] for line in csv.DictReader(file)}
    assert verdicts["combined"] == "reproduced"
    names = {path.name for path in (folder / "figures").iterdir()}
    assert {"force_methods.png", "force_methods.svg", "wrong_ground_stiffness.png"} <= names
    again = python("-m", "pipelines.force_methods", "--quick", "--folder", str(tmp_path), folder=tmp_path)
    assert "nothing changed" in again.stdout
