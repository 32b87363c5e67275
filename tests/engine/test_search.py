"""Searches by Optuna: what a storage keeps of them."""

import time

import optuna
import pytest
from support.command import started, sweep, table_of

from cmacexp.engine.job_store import list_jobs

SHORT = ("scenario=one_leg", "gait.cycle_time=0.5", "gait.stroke=0.02", "cycles=1")


@pytest.mark.ci
def test_a_search_with_a_storage_goes_on_where_it_was_killed(tmp_path):
    search = ["hydra/sweeper=optuna", "hydra.sweeper.sampler.seed=1", "hydra.sweeper.storage=sqlite:///search.db"]
    more = [*SHORT, "record=metrics", "learning.rate=interval(0.05,0.3)", "optimize=transfer_rmse_y"]
    begun = started("-m", *search, "hydra.sweeper.n_trials=400", *more, "hydra.sweep.dir=s", folder=tmp_path)
    parts = tmp_path / "s" / ".jobs"
    while not (parts.exists() and any(parts.iterdir())):
        time.sleep(0.1)
    begun.kill()
    begun.communicate()
    known = len(list_jobs(tmp_path / "s"))
    assert known, "what was done is kept"
    refused = sweep(*search, f"hydra.sweeper.n_trials={known + 2}", *more, folder=tmp_path)
    assert (refused.returncode, "add sweep.resume=true" in refused.stderr) == (2, True)
    again = sweep(*search, f"hydra.sweeper.n_trials={known + 4}", *more, "sweep.resume=true", folder=tmp_path)
    assert (again.returncode, again.stdout.count("finished before, not run again")) == (0, known)
    table = table_of(tmp_path)
    assert table["run"].tolist() == [*range(len(table))]
    assert (table["status"] == "completed").all()
    study = optuna.load_study(study_name="s", storage=f"sqlite:///{tmp_path}/search.db")
    assert [trial.value for trial in study.trials] == table["final_transfer_rmse_y"].tolist()
