"""The exact messages that users see: ``messages.txt`` lists what is typed and what is answered.

A line that starts with ``$`` is a whole command, or config overrides, whose scenario is made and run; one that starts
with ``>>>`` is Python. Add a line and renew all answers with
``PYTHONPATH=tests python tests/commands/test_messages.py``, then read the diff.
"""

import os
import re
import shlex
import shutil
import tempfile
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from support.command import python
from support.controllers import CONTROLLERS
from support.robots import OWN
from support.rollout import roll_out

import cmacexp
from cmacexp.config.compose import compose_config
from cmacexp.config.fields import listed
from cmacexp.config.gait import PATTERNS
from cmacexp.errors import CmacexpError
from cmacexp.experiment.objective import check_metric, list_metrics
from cmacexp.loop import stop
from cmacexp.loop.scenario import make_scenario
from cmacexp.metrics.drift import Drift, format_drift
from cmacexp.plants.protocol import new_measurement
from cmacexp.report.terminal import COMPILING

PAGE = Path(__file__).with_name("messages.txt")
COMPONENTS = """
from cmacexp.feedforward import CmacFeedforward
from cmacexp.plants import AnalyticPlant

class Words(Still):
    def act(self, reference, measurement): return Action("none", np.zeros((self.legs, 2)))

class Infinite(Still):
    def act(self, reference, measurement): return Action(np.full((self.legs, 2), np.inf), np.zeros((self.legs, 2)))

class Silent(Still):
    def act(self, reference, measurement): return None

class Raises(Still):
    def act(self, reference, measurement): return {}["torque"]

class RaisesAtReset(Still):
    def reset(self, setup, feedforward): raise RuntimeError("no contact to the robot")

class NoPlant(AnalyticPlant):
    def step(self, torque): return torque

class NoTorque(CmacFeedforward):
    def predict(self, reference, learning_error): return None
"""
RUN = ["scenario=one_leg", "cycles=2", "record=trace"]


def make_folder(folder: Path) -> None:
    """Custom components, a run, and what can be wrong with one."""
    (folder / "my_components.py").write_text(CONTROLLERS + COMPONENTS)
    (folder / "my_mistake.py").write_text("import no_such_module\n")
    (folder / "my_syntax.py").write_text("def f(:\n")
    (folder / "my_exit.py").write_text("raise SystemExit(0)\n")
    shutil.copy(OWN, folder / "robot.xml")
    (folder / "empty").mkdir()
    (folder / "tables").mkdir()
    (folder / "tables" / "sweep.csv").write_text("a,b\n1,2\n")
    cmacexp.run(RUN, folder / "run")
    cmacexp.run([*RUN, "record.cycles=[1]"], folder / "thinned")
    learnt = cmacexp.run([*RUN, "record.weights=true"], folder / "learnt").folder
    (learnt / "weights.npz").write_bytes(b"other")
    for name in ("killed", "changed", "edited", "incomplete", "shapeless", "unreadable"):
        shutil.copytree(folder / "run", folder / "runs" / name)
    (folder / "runs" / "killed" / "manifest.json").unlink()
    (folder / "runs" / "incomplete" / "metrics.csv").unlink()
    (folder / "runs" / "unreadable" / "manifest.json").write_text("{")
    (folder / "runs" / "shapeless" / "manifest.json").write_text('{"status": "completed", "config": [], "files": {}}')
    edited = folder / "runs" / "edited" / "manifest.json"
    edited.write_text(edited.read_text().replace("completed", "fell"))
    trace = folder / "runs" / "changed" / "trace.parquet"
    pq.write_table(pq.read_table(trace).slice(0, 600), trace)


def run_config(overrides: list[str]) -> str:
    """What a run with these overrides says of its mistake, or how it ended."""
    try:
        config = compose_config(overrides)
        check_metric(config.optimize, config.machine.kind)
        end = roll_out(make_scenario(config))
    except CmacexpError as error:
        return f"error: {error}"
    return f"{end.status} {end.cause}".rstrip()


def run_command(words: list[str]) -> str:
    """Exit code and output of a command."""
    done = python(*words, folder=Path.cwd())
    return f"{done.stdout}{done.stderr}exit code {done.returncode}"


def evaluate(expression: str) -> str:
    """The value of an expression as text, or the message of its mistake."""
    try:
        return str(eval(expression, NAMES))
    except CmacexpError as error:
        return f"error: {error}"


def describe(status: int, q: float = 0.0, dq: float = 0.0, body: tuple[float, float, float] = (0.5, 0.0, 0.0)) -> str:
    """How a stop of the quadruped in this state is described."""
    mechanism = make_scenario(compose_config(["scenario=quadruped", "feedforward=none"])).setup.mechanism
    limits = stop.new_limits(mechanism, np.zeros(1), 0.01)
    state = new_measurement(4)._replace(q=np.full((4, 2), q), dq=np.full((4, 2), dq), body=np.array(body))
    return stop.describe_stop(limits, status, 7, 0.01, state)


NAMES = {
    "np": np,
    "stop": stop,
    "describe": describe,
    "Drift": Drift,
    "format_drift": format_drift,
    "run": cmacexp.run,
}
"""What Python lines of the page can use."""


LISTS = {
    "METRICS": ", ".join(list_metrics("leg")),
    "GAITS OF ONE LEG": listed(name for name, gait in PATTERNS.items() if gait.legs == 1),
    "GAITS OF FOUR LEGS": listed(name for name, gait in PATTERNS.items() if gait.legs == 4),
}
"""Choices that an addition extends, by what stands for them on the page."""


def answer(line: str) -> str:
    """What is answered to a line of the page; times, places and lists that change are replaced."""
    kind, _, text = line.partition(" ")
    if kind == ">>>":
        found = evaluate(text)
    else:
        words = shlex.split(text)
        found = run_command(words[1:]) if words[:1] == ["python"] else run_config(words)
    found = found.replace(f"{COMPILING}\n", "").replace(str(Path.cwd()), "FOLDER")
    for name, choices in LISTS.items():
        found = found.replace(f"choose from {choices}", f"choose from {name}")
    found = found.replace(cmacexp.__version__, "VERSION")
    found = re.sub(r"in [\d.]+ s, loop [\d.]+ us a step", "in TIME s, loop TIME us a step", found)
    return "\n".join(part.rstrip() for part in found.splitlines()).strip() + "\n"


def read_page() -> list[str]:
    """Blocks of the page: a comment, or a line and its answer."""
    return re.split(r"\n\n(?=\$ |>>> |# )", PAGE.read_text().rstrip("\n"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    found = tmp_path_factory.mktemp("messages")
    make_folder(found)
    return found


LINES = [block for block in read_page() if not block.startswith("#")]


@pytest.mark.parametrize("block", LINES, ids=[block.splitlines()[0] for block in LINES])
def test_message(block, folder, monkeypatch):
    monkeypatch.chdir(folder)
    line, _, expected = block.partition("\n")
    assert answer(line) == expected + "\n", f"if this is meant, renew the page: python {Path(__file__).name}"


def test_every_message_is_one_short_line_without_a_stack_trace():
    for block in LINES:
        errors = [line for line in block.splitlines() if line.startswith("error: ")]
        assert len(errors) <= 1
        assert max(map(len, block.splitlines()[1:])) < 600
        assert "Traceback" not in block


def renew() -> None:
    """Write the page again with today's answers."""
    blocks, page = read_page(), PAGE.resolve()
    with tempfile.TemporaryDirectory() as name:
        os.chdir(Path(name).resolve())
        make_folder(Path.cwd())
        for i, block in enumerate(blocks):
            if not block.startswith("#"):
                line = block.splitlines()[0]
                blocks[i] = f"{line}\n{answer(line)}".rstrip("\n")
                print(blocks[i], flush=True)
        os.chdir(page.parent)
    page.write_text("\n\n".join(blocks) + "\n")


if __name__ == "__main__":
    renew()
