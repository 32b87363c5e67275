"""No text that comes from outside becomes HTML: each page is parsed, and has no tag, link or picture of it."""

import re
import shutil
from html import escape
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from support.command import call, sweep
from support.logs import MODEL, simulate_log
from support.manifests import accept, change_manifest

import cmacexp
from cmacexp.report.figures import Panel, Series, draw
from cmacexp.report.page import Drawing, Renderer, Report, Section, escape_markdown, render_markdown, write_report

MARK = "a<img src=x onerror=alert(1)>\"'&amp;"
LINK = "[l](javascript:alert(2)) ![p](x:y) **b** _e_ <https://z> `<u>` `"
HARMLESS = re.compile(
    "html|head|meta|title|style|body|div|nav|a|main|h[123]|p|section|table|caption|thead|tbody|tr|th|td|figure|"
    "figcaption|footer|details|summary|svg|g|path|defs|clippath|rect|use|text|span|[uo]l|li|code|sub|i|br|strong"
)
"""Tags of the pages here that texts of others do not ask for."""


class Page(HTMLParser):
    """The texts of a page; a tag or an attribute that no page of this project has is an error."""

    def __init__(self, path: Path):
        super().__init__()
        self.texts, self.kept = list[str](), ""
        self.feed(path.read_text(encoding="utf-8"))
        self.text = " ".join(self.texts)

    def handle_starttag(self, tag, attrs):
        assert HARMLESS.fullmatch(tag), tag
        for name, value in attrs:
            assert not name.startswith("on"), name
            assert name not in ("href", "src") or value.startswith(("#", "./", "../")), value

    def handle_data(self, data):
        self.texts.append(data)


def test_a_value_in_markdown_stays_a_text(tmp_path):
    """In text, at the begin of a line and of a list item, in headings, captions and tables."""
    frame = pd.DataFrame({MARK: [MARK, f"{LINK}\n\n[l](http://z)"]})
    parts = (
        "{{ x }}",
        "- {{ y }} and {{ x }}",
        "## {{ x }}",
        "{{ table('t', x) }}",
        "{{ list | join(', ') }}",
        "{{ z }}",
    )
    page = "\n\n".join(parts)
    values = {"x": MARK, "y": LINK, "z": "- 1. item", "list": [LINK, "# " + MARK, "\n\n# h"]}
    sections = render_markdown(page, tmp_path, MARK, Renderer(tmp_path), {}, {"t": lambda: frame}, values)
    path = write_report(Report(MARK, MARK, sections, {}), tmp_path / "page")
    read = Page(path)
    assert read.text.count(MARK) == 3 + 4 + 6, "in the head of the page, in the navigation and headings, in the texts"
    assert read.text.count(LINK.partition("`")[0]) == 3
    assert path.read_text().count("<li>") == 1


@pytest.mark.parametrize("text", ["`a", "``a`", "\\`<u>`", "`<u>``<b>`", "```<u>```", "x`<u>`"])
def test_code_spans_of_a_value_do_not_open_what_another_one_has_closed(text, tmp_path):
    page = "{{ x }} {{ y }} {{ x }}"
    (section,) = render_markdown(page, tmp_path, "T", Renderer(tmp_path), {}, {}, {"x": text, "y": "`<img src=x>`"})
    assert not {"<u>", "<b>", "<img"} & {f"<{tag}" for part in section.parts for tag in str(part).split("<")[1:]}
    assert "<code>&lt;img src=x&gt;</code>" in str(section.parts[0])


def test_a_dollar_in_a_name_begins_no_formula(tmp_path):
    name = "a$\\frac$"
    series = [Series(f"{name}{number}", np.arange(3), np.arange(3.0)) for number in range(2)]
    figure = draw([Panel(name, name, name, series, ticks=[name] * 3)], legend_title=name)
    path = write_report(Report("T", "S", [Section("F", [Drawing("f", figure, name)])], {}), tmp_path / "page")
    assert Page(path).text.count(name) == 10


def test_what_is_html_already_stays_html():
    assert escape_markdown(escape_markdown("a_b")) == "a&#95;b"


def test_pages_of_a_strangers_run_show_its_texts_as_texts(leg, tmp_path):
    """Its folder, cause, components and overrides."""
    folder = shutil.copytree(leg.folder, tmp_path / MARK.replace("/", ""))
    config = leg.config | {"scenario": MARK, "feedforward": leg.config["feedforward"] | {"_target_": f"x.{MARK}"}}
    change_manifest(folder, config=config, cause=MARK, overrides=[f"scenario={MARK}"], status="failed")
    accept(folder)
    (other := shutil.copytree(leg.folder, tmp_path / "other"))
    for arguments in ([folder], [folder, other]):
        done = call("report", *arguments, "--out", tmp_path / "page")
        assert done.returncode == 0, done.stderr
        assert MARK in Page(tmp_path / "page" / "report.html").text
    html = cmacexp.load(folder)._repr_html_()
    assert "<img" not in html


def test_the_page_of_a_sweep_shows_values_as_texts(tmp_path):
    (tmp_path / MARK).mkdir()
    words = ("scenario=force_step", "gait.cycle_time=0.5", "cycles=1", "seed=0,1", "hydra/launcher=basic")
    sweep(*words, folder=tmp_path / MARK)
    folder = (tmp_path / MARK / "s").rename(tmp_path / f"s{MARK}")
    assert call("report", folder).returncode == 0
    assert MARK in Page(folder / "report" / "report.html").text


@pytest.mark.ci
def test_the_page_of_a_log_shows_names_of_joints_and_columns_as_texts(tmp_path):
    names = [f"{MARK}{number}[l](x)".replace('"', "") for number in range(2)]
    model = MODEL.read_text()
    for own, name in zip(("hip_joint", "knee_joint"), names, strict=True):
        model = model.replace(own, escape(name))
    (tmp_path / "robot.xml").write_text(model)
    log = simulate_log(parts=6)
    angles = {f"pos_{name}": log.angle[:, j] for j, name in enumerate(names)}
    commands = {f"cmd_{name}": log.command[:, j] for j, name in enumerate(names)}
    frame = pd.DataFrame({"time": log.time, **angles, **commands, MARK: np.zeros(len(log.time))})
    frame.to_csv(tmp_path / "log.csv", index=False)
    words = ["log.csv", "--robot", "robot.xml", "--kp", "20,15", "--kd", "0.8,0.6", "--quick", "--out", "page"]
    done = call("gap", *words, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert names[0] in Page(tmp_path / "page" / "report.html").text
