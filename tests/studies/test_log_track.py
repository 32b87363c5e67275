"""The log track: what fails is a row with its cause, harm ends what is guarded, entrants see no measurement early."""

import pytest
from support.command import python
from support.doors import BadInput, Gap, read_table
from support.logs import make_problem, simulate_log

from pipelines.benchmark.log_track import GUARDED, choose_makers, try_method

ENTRANTS = '''
import numpy as np


class Before:
    """The torque of the stroke before, by phase; none of what was measured in a stroke is known before its end."""

    def __init__(self):
        self.strokes = []

    def fit(self, strokes):
        assert len(strokes) == len(self.strokes) + 1 and all(each.angle is not None for each in strokes)
        self.strokes = strokes

    def predict(self, stroke):
        assert stroke.angle is None and stroke.torque is None
        if not self.strokes:
            return 0.0 * stroke.command
        last = self.strokes[-1]
        return np.stack([np.interp(stroke.phase, last.phase, own) for own in last.torque.T], axis=1)


class Raises(Before):
    def fit(self, strokes):
        raise RuntimeError("broken")


class Undefined(Before):
    def predict(self, stroke):
        return np.nan * stroke.command


class Narrow(Before):
    def predict(self, stroke):
        return stroke.command[:, :1]
'''


class Wrong:
    """Learns the contrary."""

    def __init__(self, signals):
        self.signals, self.factor = signals, 0.0

    def predict(self, rows):
        return self.factor * self.signals.torque[rows]

    def learn(self, rows, torque):
        self.factor -= 1.0


@pytest.fixture(scope="module")
def gap():
    return Gap(make_problem(simulate_log()), {})


def test_a_guarded_method_has_no_effect_after_a_stroke_with_harm(gap):
    signals = gap.signals
    scores = try_method(gap, "wrong", lambda: Wrong(signals), GUARDED)
    assert [round(each) for each in scores["left"]] == [100, 200, *[100] * (signals.count - 2)]
    assert (scores["harmful"], scores["cause"]) == (1, "")


@pytest.mark.ci
def test_entrants_take_part_and_one_that_fails_is_a_row_with_its_cause(tmp_path):
    (tmp_path / "entrants.py").write_text(ENTRANTS)
    entered = [w for name in ("Before", "Raises", "Undefined", "Narrow") for w in ("--method", f"entrants.{name}")]
    done = python("-m", "pipelines.benchmark", "--log", "simulated", *entered, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    place = tmp_path / "outputs" / "studies" / "log_track-simulated"
    scores = (
        read_table(place / "log_scores.parquet", texts=True)
        .to_pandas()
        .set_index(["setting", "method"])
        .loc["updated"]
    )
    assert scores["value"]["Before"] == pytest.approx(scores["value"]["stroke before"], rel=0.1)
    assert scores.index[scores["status"] == "failed"].tolist() == ["Raises", "Undefined", "Narrow"]
    assert [text.split(":")[0] for text in scores["cause"] if text] == ["RuntimeError", "ValueError", "ValueError"]
    assert "3 of 3" in (page := (place / "report.html").read_text())
    assert "An identified plant leaves less torque than any table or network: yes" in page
    assert scores["value"].idxmin().startswith("identified")


def test_what_takes_no_log_is_refused(gap):
    with pytest.raises(BadInput, match=r"^--method"):
        choose_makers(gap, None, ["numpy.ndarray"], identified=False)
