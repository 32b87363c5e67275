"""The log of a robot: rows are on the disk while it moves, and a killed run loses a second at most."""

import numpy as np
import pandas as pd
import pytest

from cmacexp.addons.unitree.log import LOGGED, Log, name_partial, recover_log
from cmacexp.errors import BadInput

JOINTS = [f"joint{n}" for n in range(12)]


def fill(path, rows):
    log = Log(path, 0.1, JOINTS)
    for row in range(rows):
        log.add(np.full((4, 3), float(row)), *range(1, len(LOGGED)))
    return log


def test_a_log_ends_as_a_table(tmp_path):
    fill(path := tmp_path / "a.parquet", 25).close()
    table = pd.read_parquet(path)
    assert table["q_joint3"].tolist() == list(range(25))
    assert table["time"].tolist() == pytest.approx(np.arange(25) * 0.1)
    assert (table["kd_joint11"] == len(LOGGED) - 1).all()
    assert not name_partial(path).exists()


def test_a_killed_run_leaves_all_but_the_last_second(tmp_path):
    log = fill(path := tmp_path / "a.parquet", 25)
    log._queue.put(None)  # what a kill leaves: the rows that were handed over
    log._thread.join()
    assert not path.exists()
    assert recover_log(path) == 20
    assert len(pd.read_parquet(path)) == 20
    with pytest.raises(BadInput, match="a killed run leaves"):
        recover_log(path)
