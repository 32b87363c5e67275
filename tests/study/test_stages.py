"""Stages of a study: what has changed is made again, and no more."""

import pandas as pd
import pytest
from support.command import python

STUDY = """
from pathlib import Path
from cmacexp.study import *

def size(run):
    with Path("did.txt").open("a") as file:
        file.write("measured ")
    return {value}

def table(results):
    with Path("did.txt").open("a") as file:
        file.write("paged ")
    return results.table[["size"]]

def sample(results):
    with Path("did.txt").open("a") as file:
        file.write("judged ")
    return results.measure("size")

STUDY = Study(
    title="T", question="Q", runs=lambda quick: grid("cycles=1", over={{"gait.lift": {lifts}}}),
    measures={{"size": size}}, tables={{"t": table}},
    findings={{"small": Finding([Criterion("size", sample, at_most(5.0))])}},
)
"""
PAGE = "{{ table('t') }} {{ finding('small') }}"


@pytest.mark.ci
def test_only_stages_whose_input_changed_are_made_again_and_others_are_read(tmp_path):
    def make(page=PAGE, value="1.0", lifts=(0.1, 0.15)):
        (tmp_path / "staged.py").write_text(STUDY.format(value=value, lifts=lifts))
        (tmp_path / "staged.md").write_text(page)
        (tmp_path / "did.txt").write_text("")
        done = python("-m", "cmacexp.study", "staged.py", "--workers", "1", folder=tmp_path)
        assert done.returncode == 0, done.stderr
        return (tmp_path / "did.txt").read_text().split(), done

    first, said = make()
    assert first == ["measured", "measured", "judged", "paged"]
    again, said_again = make()
    assert (again, said_again.stdout) == ([], said.stdout)
    assert " 0 of them to be run" in said_again.stderr
    assert make(page=f"Changed. {PAGE}")[0] == ["paged"]
    assert "Changed." in (tmp_path / "outputs/studies/staged/report.html").read_text()
    changed, said = make(value="9.0")
    assert changed == ["measured", "measured", "judged", "paged"]
    assert " 0 of them to be run" in said.stderr
    assert "size: 9 [deterministic], n = 2; limit at most 5: no." in " ".join(said.stdout.split())
    more, said = make(value="9.0", lifts=(0.1, 0.15, 0.2))
    assert " 1 of them to be run" in said.stderr
    # The study is the file of its measures too, and every measure of a changed file is made again.
    assert more == ["measured"] * 3 + ["judged", "paged"]
    kept = pd.read_parquet(tmp_path / "outputs/studies/measures/staged.parquet")
    assert kept["size"].tolist() == [9.0, 9.0, 9.0]
