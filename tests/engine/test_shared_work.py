"""Work of several processes: what is done of it is counted where it was begun."""

import io
import os
import sys
import time

import pytest

from cmacexp.experiment.workers import VARIABLE, share_progress, shared_progress, workers


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_work_of_other_processes_is_counted(monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setattr(sys, "stderr", screen := Terminal())
    with shared_progress("sweep", lambda: 4, "jobs"):
        share_progress(2)(0.5)
        share_progress(0)(1.0)
        while "1/4 jobs (37.5 %)" not in screen.getvalue():
            time.sleep(0.01)
    share_progress(1)(0.5)  # nobody shows it


@pytest.mark.ci
def test_processes_that_work_on_report_to_who_shows_it_now():
    with workers() as each:
        first, second = (each(what, os.getenv, [(VARIABLE,)]) for what in ("looking", "running"))
    assert first != second
