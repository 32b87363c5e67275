"""README and documentation: every command, every block of Python and the notebook run as printed.

All pages share a folder and come in the order of the site. A page can use the runs of those before it, so this file
is run as a whole. A command that occurs again is not repeated. ``tests/support/blocks.toml`` says what is different
here: what is added to the commands of a block, where a test need not wait as long as a reader, what they end with,
which are run at night alone, or the tests that run what it does.

``title="my_file.py"`` makes a block a file.
"""

import json
import re
import shlex

import pytest
from support.command import ROOT, python
from support.pages import PAGES, blocks
from support.robots import OWN, needs_models

import cmacexp

pytestmark = pytest.mark.ci

OWN_TEST = "add-a-study.md"
"""The page that ``test_add_a_study.py`` runs."""
HERE = [block for page in PAGES for block in blocks(page) if page != OWN_TEST]


def steps():
    """What is done, in order: a command with what is added to it and its exit code, or the code of a script."""
    found = {}
    for block in HERE:
        added, code = block.notes.get("tests", ""), int(block.notes.get("exit_code", 0))
        marks = [pytest.mark.nightly] * ("slow" in block.notes) + [needs_models] * ("machine=go" in block.code)
        assert (ROOT / block.notes.get("run_by", "")).exists(), block.notes
        if block.language == "bash" and "run_by" not in block.notes:
            for line in block.code.splitlines():
                found.setdefault((line, added, code), (f"{block.page}: {line}", marks))
        elif block.language == "python" and not block.title:
            found[block.code, "", 0] = f"{block.page}: script {len(found)}", marks
    return [pytest.param(*step, id=name, marks=marks) for step, (name, marks) in found.items()]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The folder of all pages, with the files that they show."""
    folder = tmp_path_factory.mktemp("docs")
    for block in (block for block in HERE if block.title):
        path = folder / block.title
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"{path.read_text()}\n\n{block.code}" if path.exists() else block.code)
    return folder


@pytest.mark.parametrize(("code", "added", "exit_code"), steps())
def test_it_runs_as_printed(code, added, exit_code, folder):
    if code.startswith("python -m "):
        words = [*shlex.split(code)[2:], *added.split()]
        words += ["--no-viewer"] if words[0] == "cmacexp.replay" else []
    else:
        (folder / "script.py").write_text(code)
        words = ["script"]
    done = python("-m", *words, folder=folder)
    assert done.returncode == exit_code, done.stderr


def test_the_notebook_is_its_example_and_is_stored_without_results():
    """``jupytext --to ipynb examples/01_one_leg.py`` makes it."""
    cells = json.loads((ROOT / "examples" / "01_one_leg.ipynb").read_text())["cells"]
    assert not any(cell.get("outputs") or cell.get("execution_count") for cell in cells)
    code = "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")
    script = (ROOT / "examples" / "01_one_leg.py").read_text()
    assert code.split() == re.sub(r"^# .*$", "", script, flags=re.MULTILINE).split()


def test_the_components_of_the_pages_control_and_are_learned(folder):
    pressed, rusty = (cmacexp.load(folder / "outputs" / name).metrics for name in ("leg", "rusty"))
    assert abs(pressed.force_steady_state_error.iloc[-1]) < 0.001
    assert rusty.transfer_rmse_x.iloc[-1] < 0.5 * rusty.transfer_rmse_x[0]


def test_runs_do_what_their_page_says(folder):
    """Learning stops, the torque is limited, more cycles repeat the first ones."""
    stopped, limited, ten, paper = (
        cmacexp.load(folder / "outputs" / name).metrics for name in ("stopped", "limited", "ten", "paper")
    )
    assert stopped.weight_norm.nunique() == 1
    assert limited.torque_peak.max() == 10.0
    columns = ["transfer_rmse_x", "force_rmse", "weight_norm"]
    assert ten[columns].head(5).equals(paper[columns])


@pytest.mark.nightly
def test_the_law_as_published_diverges_and_drifts_when_the_page_says(tmp_path):
    run = cmacexp.run(["cycles=400", "record=metrics"], tmp_path / "run")
    text = " ".join(PAGES["long-runs.md"].read_text().split())
    assert set(re.findall(r"diverges in cycle (\d+)", text)) == {str(run.metrics.cycle.iloc[-1])}
    assert set(re.findall(r"detected in cycle (\d+)", text)) == {str(run.manifest["drift"]["named"])}


def test_what_the_pages_say_to_type_is_a_config(make_config):
    """Commands within the text, and what is typed for one's own robot."""
    typed = [
        words for path in PAGES.values() for words in re.findall(r"`python -m cmacexp ([^`]+)`", path.read_text())
    ]
    for block in filter(lambda block: block.language == "text", blocks("runs.md")):
        typed += block.code.replace("python -m cmacexp ", "").replace("my_robot.urdf", str(OWN)).splitlines()
    needs = re.compile(r"DIR|-m |gait.speed|machine=(go|a1|b2|aliengo|hyq|mini|spot)")
    for words in typed:
        if not needs.search(words):
            make_config(*(word for word in words.split() if "=" in word))
