"""The whole command: a log of known truth becomes page, JSON and option file; a real log, where there is one."""

import json

import numpy as np
import pandas as pd
import pytest
import yaml
from support.command import call
from support.logs import COULOMB, MODEL, NAMES, ROTORS, simulate_log
from support.pages import ROOT
from support.robots import needs_models

REAL = ROOT.parent / "shared" / "data" / "go2_swing" / "log.parquet"
"""A log of a real Go2, where it is."""


def write(path, log):
    angles = {f"pos_{name}": np.degrees(log.angle[:, j]) for j, name in enumerate(NAMES)}
    commands = {f"cmd_{name}": np.degrees(log.command[:, j]) for j, name in enumerate(NAMES)}
    pd.DataFrame({"time": log.time, **angles, **commands}).to_csv(path, index=False)


@pytest.mark.nightly
def test_a_log_becomes_a_page_with_the_joints_that_made_it(tmp_path):
    write(tmp_path / "log.csv", simulate_log(parts=50))
    units = ["--units", "angle=deg,command=deg"]
    done = call("gap", "log.csv", "--robot", MODEL, "--kp", "20,15", "--kd", "0.8,0.6", *units, folder=tmp_path)
    assert (done.returncode, done.stderr.count("Traceback")) == (0, 0)
    folder = tmp_path / "outputs" / "gap" / "log"
    found = json.loads((folder / "gap.json").read_text())
    assert found["summary"] in done.stdout
    assert found["summary"] in (folder / "report.html").read_text()
    for j, name in enumerate(NAMES):
        own = found["parameters"][name]
        assert own["rotor_inertia"]["value"] == pytest.approx(ROTORS[j], rel=0.1)
        assert np.mean(own["coulomb_friction"]["value"]) == pytest.approx(COULOMB[j], rel=0.05)
    distance = found["validation"]["distance"]
    assert distance["identified"]["last"] < 1.0 < distance["model"]["last"]
    left = found["left"]
    assert left["identified from earlier strokes"]["value"] < 5.0 < left["stroke before"]["value"]
    assert all(own["low"] <= own["value"] <= own["high"] for own in left.values())
    acting = found["acting"]["with_velocity"]
    assert acting["inverse dynamics of the identified joints"]["tracking"]["worst"] < 15.0
    assert any("exchanged" not in note for note in found["notes"])
    assert yaml.safe_load((folder / "as_built.yaml").read_text())["joints"].keys() == {"hip_joint", "knee_joint"}
    wrong = call("gap", "log.csv", "--robot", MODEL, "--kp", "20,15", "--kd", "0.8", folder=tmp_path)
    assert (wrong.returncode, wrong.stderr.count("\n")) == (2, 1)


@pytest.mark.nightly
@needs_models
# The log is others' and not in the repository; the tests above identify a robot from logs that they make.
@pytest.mark.skipif(not REAL.is_file(), reason="needs the log of a real Go2")
def test_a_real_go2_is_identified_on_strokes_that_the_fit_did_not_see(tmp_path, compiled):
    assert call("gap", REAL, "--robot", "go2", "--out", "page", folder=tmp_path).returncode == 0
    found = json.loads((tmp_path / "page" / "gap.json").read_text())
    distance = found["validation"]["distance"]
    assert distance["identified"]["middle"] < 2.6
    assert distance["identified"]["last"] < 4.0
    assert distance["identified, the reverse"]["before"] < 2.6
    own = found["left"]["identified from earlier strokes"]
    assert own["value"] < 7.0
    assert own["fastest"]["value"] < 11.0
    assert own["frozen"]["fastest"]["value"] < 13.0
    assert [words.split()[0] for words in found["refused"][:2]] == ["masses", "tilt"]
    best = min(each["tracking"]["worst"] for each in found["acting"]["with_velocity"].values())
    assert best < 15.0
