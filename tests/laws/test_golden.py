"""One leg gives the figures it gave: a table of all its metrics, held to twelve digits.

Where a change of the figures is meant, renew the table with ``python tests/laws/test_golden.py``, look at its diff
(every digit is in it), and say in the commit what moved and why. A change of rounding alone (other libraries, another
processor) moves the last digits; a change of one part in 10^12 is taken for one of the laws.
"""

from pathlib import Path

import numpy as np
import pandas as pd

import cmacexp

GOLDEN = Path(__file__).parent / "golden" / "one_leg_metrics.csv"
RUN = ("scenario=one_leg", "record=metrics")


def test_one_leg_gives_the_figures_it_gave(stored):
    golden, measured = pd.read_csv(GOLDEN), stored(*RUN).metrics
    assert [name for name in measured if name in golden] == list(golden)
    assert golden.cycle.tolist() == [1, 2, 3, 4, 5]
    for name, column in golden.items():
        scale = np.nan_to_num(column.abs().max())
        np.testing.assert_allclose(measured[name].astype(float), column, rtol=0.0, atol=1e-12 * scale, err_msg=name)


if __name__ == "__main__":
    from tempfile import TemporaryDirectory

    with TemporaryDirectory() as folder:
        table = cmacexp.run(RUN, f"{folder}/run").metrics
    table[list(pd.read_csv(GOLDEN))].to_csv(GOLDEN, index=False, na_rep="nan", lineterminator="\n")
