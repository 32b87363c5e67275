"""What the study of sensors measures, on made runs, and the failures that it draws."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from cmacexp.report.run_summary import RunSummary
from cmacexp.study.results import Results, Row
from pipelines import sensors


def stored(*dropped: tuple[int, int], fault: dict | None = None) -> SimpleNamespace:
    """A run that rejected sensors of these legs at these steps."""
    sensed = {"force": {"fault": fault}} if fault else {"_target_": "cmacexp.sensors.PerfectSensors"}
    config = {"sampling_period": 0.005, "sensors": sensed}
    return SimpleNamespace(config=config, manifest={"dropped": [{"leg": leg, "step": step} for leg, step in dropped]})


def row(status: str = "completed", metrics: dict[str, float] | None = None, **settings) -> Row:
    """A run of ten cycles with constant metrics."""
    histories = {name: np.full(10, value) for name, value in (metrics or {}).items()}
    summary = RunSummary(Path("run"), status, "", {}, 10, histories)
    return Row(summary, {"seed": 0, "level": None, **settings}, {}, {})


def test_every_kind_of_failure_strikes_every_leg_at_a_moment_and_with_a_seed_of_its_own():
    found = sensors.failures()
    assert found == sensors.failures()
    assert list(found) == list(sensors.KINDS)
    cases = [overrides for legs in found.values() for overrides in legs.values()]
    for key in ("sensors.force.fault.start=", "seed="):
        own = {text for overrides in cases for text in overrides if text.startswith(key)}
        assert len(own) == len(cases) == 4 * len(found)


def test_a_broken_sensor_is_rejected_some_samples_after_its_failure():
    fault = {"kind": "zero", "legs": [2], "start": 1.0}
    assert sensors.rejected_after(stored((2, 230), fault=fault)) == 30
    assert sensors.rejected_after(stored((1, 230), fault=fault)) == np.inf
    assert sensors.rejected_after(stored((2, 230))) == np.inf


def test_a_sensor_without_fault_is_rejected_wrongly():
    fault = {"kind": "zero", "legs": [2], "start": 1.0}
    assert sensors.rejected_sound(stored((2, 230), (3, 250), fault=fault)) == 1
    assert sensors.rejected_sound(stored((2, 230), fault={**fault, "kind": "none"})) == 1
    assert sensors.rejected_sound(stored((2, 230))) == 1


def test_failures_count_only_where_the_unbroken_machine_walks():
    rows = []
    for gain, sound in ((0.1, "completed"), (0.2, "fell")):
        own = {"gain": f"{gain:g}", sensors.GAIN_KEY: gain, "feedforward": "cmac"}
        rows.append(row(sound, part=sensors.SOUND, **own))
        rows += [row(status, part=sensors.BREAK, check="check", **own) for status in ("completed", "fell")]
    found = sensors.where_sound_walks(Results(rows), "check", (0.1, 0.2)).completed
    assert found == [True, False]


def noisy(level: float | None, transfer: float, force: float, torque: float) -> Row:
    metrics = {"transfer_rmse_y": transfer, "force_rmse": force, "feedback_rms": torque}
    signal = sensors.NONE if level is None else "force"
    return row(metrics=metrics, machine=sensors.LEG, signal=signal, level=level)


def test_noise_is_compared_with_the_same_seed_and_the_torque_with_the_errors_where_it_is_felt():
    results = Results([noisy(None, 1, 2, 4), noisy(0.1, 1, 2, 5), noisy(0.2, 1, 3, 8), noisy(0.4, 1, 6, 8)])
    assert sensors.worsening(results, "force_rmse").tolist() == pytest.approx([1.0, 1.5, 3.0])
    assert sensors.torque_first(results) == [True, False]  # at 0.1 nothing is felt
