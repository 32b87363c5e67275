"""Sweeps on SLURM: one node on this machine, started for the test; Debian's slurm-wlm and munge, and root."""

import os
import shutil
import signal
import subprocess
import time
from pathlib import Path

import pandas as pd
import pytest
from support.command import started, sweep

NODE = Path(__file__).parents[1] / "support" / "slurm_node.sh"
JOBS = ("scenario=one_leg", "feedforward=none", "warn=false", "record=metrics", "seed=range(8)", "cycles=4000")
ON_SLURM = ("hydra/launcher=submitit_slurm", "hydra.launcher.timeout_min=5", "sweep.chunk=4")


@pytest.fixture(scope="module")
def slurm(tmp_path_factory):
    if shutil.which("slurmctld") is None or os.getuid() != 0:
        pytest.skip("no slurm-wlm, or not root")
    folder = tmp_path_factory.mktemp("slurm")
    subprocess.run(["bash", NODE, "start", folder], check=True, timeout=120)
    os.environ["SLURM_CONF"] = str(folder / "slurm.conf")
    yield
    del os.environ["SLURM_CONF"]
    subprocess.run(["bash", NODE, "stop", folder], check=True, timeout=60)


@pytest.mark.nightly
def test_an_interrupted_sweep_cancels_its_tasks_and_a_resumed_one_gives_the_metrics_of_cores(slurm, tmp_path):
    begun = started("-m", *JOBS, *ON_SLURM, "hydra.sweep.dir=s", folder=tmp_path)
    while not any((tmp_path / "s" / ".jobs").glob("*")):
        time.sleep(0.2)
    begun.send_signal(signal.SIGINT)
    _, messages = begun.communicate()
    assert begun.returncode == 130
    assert "cancelled" in messages
    time.sleep(5)
    assert not subprocess.run(["squeue", "--noheader"], capture_output=True, text=True, check=True).stdout
    again = sweep(*JOBS, *ON_SLURM, "sweep.resume=true", folder=tmp_path)
    assert again.returncode == 0
    assert 0 < again.stdout.count("finished before, not run again") < 8
    other = tmp_path / "other"
    other.mkdir()
    assert sweep(*JOBS, folder=other).returncode == 0
    tables = [pd.read_parquet(folder / "s" / "metrics.parquet") for folder in (tmp_path, other)]
    pd.testing.assert_frame_equal(*tables, check_exact=True)
