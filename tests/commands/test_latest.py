"""The word ``latest`` for a folder."""

import argparse
import os

import pytest

from cmacexp.commands.command import parse_folder


def write_result(folder, time):
    folder.mkdir(parents=True)
    manifest = folder / "manifest.json"
    manifest.write_text("{}")
    os.utime(manifest, (time, time))


def test_latest_is_the_newest_run_or_sweep_and_neither_a_job_nor_a_report_nor_a_part(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_result(tmp_path / "outputs/one_leg/1", 100)
    write_result(tmp_path / "outputs/sweep", 300)
    write_result(tmp_path / "outputs/sweep/0", 400)
    write_result(tmp_path / "outputs/one_leg/1/report", 500)
    write_result(tmp_path / "outputs/one_leg/.part", 600)
    assert parse_folder("latest").as_posix() == "outputs/sweep"
    write_result(tmp_path / "outputs/one_leg/2", 350)
    assert parse_folder("latest").as_posix() == "outputs/one_leg/2"
    assert parse_folder("outputs/one_leg/1").as_posix() == "outputs/one_leg/1"


def test_a_folder_of_that_name_is_preferred_and_without_results_the_error_says_what_to_type(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(argparse.ArgumentTypeError, match="type the folder of one"):
        parse_folder("latest")
    write_result(tmp_path / "outputs/one_leg/1", 100)
    (tmp_path / "latest").mkdir()
    assert parse_folder("latest").as_posix() == "latest"
