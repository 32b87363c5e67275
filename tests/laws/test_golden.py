"""One leg gives the figures it gave: a table of all its metrics, held to twelve digits.

Where a change of the figures is meant, renew the table with ``python tests/laws/test_golden.py``, look at its diff
(every digit is in it), and say in the commit what moved and why. A change of rounding alone (other libraries, another
processor) moves the last digits; a change of one part in 10^12 is taken for one of the laws.
"""

import csv
from pathlib import Path

import numpy as np
import pytest
from support.made_traces import compute
from support.rollout import roll_out

from cmacexp.config.compose import compose_config
from cmacexp.loop.scenario import make_scenario
from cmacexp.loop.trace import assemble

GOLDEN = Path(__file__).parent / "golden" / "one_leg_metrics.csv"


def measure():
    """Metrics of ``scenario=one_leg`` by name, a value for each cycle."""
    config = compose_config(["scenario=one_leg"])
    rollout = roll_out(make_scenario(config))
    trace = assemble(rollout.plan, rollout.columns(), config.sampling_period)
    table = compute(trace, config.steps_per_cycle)
    return {name: table.column(name).to_pylist() for name in table.column_names}


def write():
    columns = measure()
    with GOLDEN.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows([repr(value) for value in row] for row in zip(*columns.values(), strict=True))


def read():
    with GOLDEN.open(newline="") as file:
        names, *rows = csv.reader(file)
    return {
        name: [float(value) for value in column] for name, column in zip(names, zip(*rows, strict=True), strict=True)
    }


@pytest.fixture(scope="module")
def measured():
    return measure()


def test_the_columns_of_the_golden_table_keep_their_order(measured):
    assert list(read()) == [name for name in measured if name in read()]
    assert (read()["cycle"], read()["leg"]) == ([1, 2, 3, 4, 5], [1] * 5)


@pytest.mark.parametrize("name", read())
def test_one_leg_gives_the_figures_it_gave(measured, name):
    golden = np.array(read()[name])
    scale = np.nanmax(np.abs(golden), initial=0.0)
    np.testing.assert_allclose(np.array(measured[name], dtype=float), golden, rtol=0.0, atol=1e-12 * scale)


if __name__ == "__main__":
    write()
