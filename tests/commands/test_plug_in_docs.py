"""The pages that show how to add parts: every block of code is run as printed."""

import re

import pandas as pd
import pytest
from support.command import ROOT, python


def blocks(page, language):
    return re.findall(rf"```{language}\n(.*?)```", (ROOT / "docs" / page).read_text(), flags=re.DOTALL)


def run_commands(page, folder):
    for line in (line for block in blocks(page, "bash") for line in block.splitlines()):
        words = line.split()
        assert words[0] == "python"
        done = python(*words[1:], folder=folder)
        assert done.returncode == 0, done.stderr


@pytest.fixture(scope="module")
def controllers(tmp_path_factory):
    """A folder in which everything of the page on controllers has been written and run."""
    folder = tmp_path_factory.mktemp("controller")
    controller, checked, _, parts = blocks("add-a-controller.md", "python")
    (folder / "my_controller.py").write_text(f"{controller}\n\n{checked}")
    (folder / "my_parts.py").write_text(parts)
    (folder / "my_configs" / "controller").mkdir(parents=True)
    (folder / "my_configs" / "controller" / "computed.yaml").write_text(blocks("add-a-controller.md", "yaml")[0])
    run_commands("add-a-controller.md", folder)
    return folder


def test_a_controller_of_thirty_lines_presses_as_desired(controllers):
    (code, *_) = blocks("add-a-controller.md", "python")
    assert len(code.splitlines()) <= 31
    last = pd.read_parquet(controllers / "outputs" / "leg" / "metrics.parquet").iloc[-1]
    assert abs(last.force_steady_state_error) < 0.001


def test_it_walks_by_command_line_and_by_config_folder(controllers):
    walks = sorted((controllers / "outputs" / "quadruped").glob("*/body_metrics.parquet"))
    assert len(walks) == 2
    for walk in walks:
        assert (pd.read_parquet(walk).tilt_max < 0.05).all()


def test_the_notebook_lines_run(controllers):
    *_, notebook, _ = blocks("add-a-controller.md", "python")
    done = python("-c", notebook, folder=controllers)
    assert done.returncode == 0, done.stderr
    assert "completed, 1200 steps" in done.stdout


def test_the_plant_of_the_page_runs_and_is_learned(tmp_path):
    (code,) = blocks("add-a-plant.md", "python")
    (tmp_path / "my_plant.py").write_text(code)
    run_commands("add-a-plant.md", tmp_path)
    metrics = pd.read_parquet(tmp_path / "outputs" / "rusty" / "metrics.parquet")
    assert metrics.transfer_rmse_x.iloc[-1] < 0.5 * metrics.transfer_rmse_x[0]
