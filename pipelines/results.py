"""``docs/results.json``: what every study gave when it last ran in full, its state, and what pages quote of it.

The file holds, by study, date, version, seeds, hashes of models and code, two witnesses, and statements with value,
interval and n; digests of the package's files once for all studies that ran on the same ones; and the sentences of
pages that were written for one verdict.

``{{ quote("one_leg_learning.bias") }}`` on a page stands for the first value of a statement, ``quote("...", 1)`` for
the second, ``interval`` for its interval, ``measured`` for both, ``size`` for its n, ``verdict`` for the verdict,
``sentence`` for the sentence of a finding. The README's section of results stands in ``readme_blocks``, likewise.
"""

import hashlib
import json
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import cmacexp
from cmacexp.addons.study.page import CLAIMS, count_verdicts
from cmacexp.addons.study.provenance import PROVENANCE, digest_package, digest_source, list_changed, make_witness
from cmacexp.addons.study.statements import MEASURED, Claim, Finding
from cmacexp.config.compose import compose_config
from cmacexp.config.machine import RobotMachine, read_model
from cmacexp.errors import require
from cmacexp.models.robot_file import package_models
from pipelines.groups import PIPELINES, all_studies, every_study

DOCS, README = PIPELINES.parent / "docs", PIPELINES.parent / "README.md"
RESULTS_FILE = DOCS / "results.json"
SCORES = {
    name: PIPELINES / "benchmark" / f"{table}.md"
    for name, table in (("benchmark", "scores"), ("log_track", "log_scores"))
}
"""Every table of the last full benchmark, and of its log track."""
PAGES = (README, *sorted(DOCS.glob("*.md")))
"""What may quote the studies."""
BLOCK = PIPELINES / "readme_blocks" / "Results.md"
"""The section of the README on results, with quotes."""
FIRST_RUN = re.compile(r"python -m cmacexp (.*)\n```\n\n.*\n\n```text\n((?:.*\n)*?.*)\n```")
"""In the README: the overrides of a run, and the table that it prints."""
QUOTE = re.compile(r'\{\{ (quote|interval|measured|size|verdict|sentence)\("(\w+)\.([^"]+)"(?:, (\d+))?\) \}\}')
NOT_MEASURED = "not measured yet"
CURRENT, EQUAL, CHANGED, NEVER = "current", "equal", "changed", "never run"
"""EQUAL: its files changed, and its witnesses gave the same values on the files of today."""
CLOSE = 1e-9
"""Relative difference of equal values; the last digits differ between processors."""
Quotable = Mapping[str, Mapping[str, Any]]
"""Statements by study and name."""


class State(NamedTuple):
    """Whether what a study gave still is what its code gives."""

    state: str
    """One of CURRENT, EQUAL, CHANGED and NEVER."""
    date: str = ""
    """Of the last full run."""
    reasons: Sequence[str] = ()
    """Files and models that have changed since."""
    confirmed: str = ""
    """Date on which the witnesses of an EQUAL study ran on the files of today."""


class PublishedResults:
    """The content of the file."""

    def __init__(self, entries: Mapping[str, Any]):
        self.code: dict[str, dict[str, str]] = dict(entries.get("code", {}))
        """Digests of files, by the hash of all of them."""
        self.studies: dict[str, dict[str, Any]] = dict(entries.get("studies", {}))
        self.sentences: list[dict[str, Any]] = list(entries.get("sentences", []))
        """``page``, ``text``, and the verdict that it ``needs`` by statement."""

    @property
    def statements(self) -> Quotable:
        """Statements by study and name."""
        return {name: study["statements"] for name, study in self.studies.items()}

    def add_studies(self, folder: Path) -> None:
        """Take every full study below ``folder``, each from its own folder, which no page over several renews."""
        for path in sorted(folder.glob(f"*/{CLAIMS}")):
            name, statements = path.parent.name, json.loads(path.read_text(encoding="utf-8"))
            if name in statements:
                provenance = json.loads(path.with_name(PROVENANCE).read_text(encoding="utf-8"))[name]
                own = {each["name"]: _quotable(each) for each in statements[name]}
                self.studies[name] = {**provenance, "code": self._add_code(provenance["code"]), "statements": own}

    def _add_code(self, files: dict[str, str]) -> str:
        """Keep digests of files; their key."""
        key = hashlib.sha256(json.dumps(files, sort_keys=True).encode()).hexdigest()[:12]
        self.code[key] = files
        return key

    def confirm(self, name: str) -> list[str]:
        """Run the witnesses of a study again, and note it if they give what they gave; else what differs.

        Witnesses are two runs of a study: they confirm neither its other runs nor its statements. The log track has
        no runs, so that nothing confirms it.
        """
        study = self.studies[name]
        differing = [line for witness in study["witnesses"] for line in repeat_witness(witness)]
        if study["witnesses"] and not differing:
            study["confirmed"] = {
                "date": datetime.now(UTC).date().isoformat(),
                "code": self._add_code(digest_package()),
                "own": _digest_own(study["own"]),
            }
        return differing

    def format(self) -> str:
        """The text of the file, without digests that no study needs any more."""
        used = {known["code"] for study in self.studies.values() for known in (study, study.get("confirmed", study))}
        code = {key: files for key, files in self.code.items() if key in used}
        entries = {"code": code, "studies": dict(sorted(self.studies.items())), "sentences": self.sentences}
        return json.dumps(entries, indent=1, ensure_ascii=False) + "\n"

    def find_state(self, name: str) -> State:
        """Whether a study is current."""
        if (study := self.studies.get(name)) is None:
            return State(NEVER)
        changed, again = self._list_changed(study), study.get("confirmed")
        if changed and again and not self._list_changed(again):
            return State(EQUAL, study["date"], changed, again["date"])
        models = {} if changed else study["models"]  # reading models takes long, and could only add reasons
        differ = [f"model of {name}" for name, own in models.items() if find_model_hash(name) not in ("", own)]
        return State(CHANGED if changed or differ else CURRENT, study["date"], [*changed, *differ])

    def _list_changed(self, known: Mapping[str, Any]) -> list[str]:
        """Files of the package and of a study that are not those of digests that are ``known``."""
        package = list_changed(self.code[known["code"]], digest_package())
        return [*package, *list_changed(known["own"], _digest_own(known["own"]))]


def run_witness(overrides: Sequence[str]) -> dict[str, Any]:
    """The entry of a run: its overrides, and the metrics of its last whole cycle."""
    with TemporaryDirectory() as folder:
        return make_witness(overrides, cmacexp.run([*overrides, "record=metrics", "warn=false"], Path(folder, "run")))


def repeat_witness(witness: Mapping[str, Any]) -> list[str]:
    """Run one of a study's runs again; the metrics of its last whole cycle that differ, with both values."""
    expected, found = witness["metrics"], run_witness(witness["overrides"])["metrics"]
    pairs = {name: (expected.get(name), found.get(name)) for name in sorted({*expected, *found})}
    return [
        f"{' '.join(witness['overrides'])}: {name} was {old!r}, is {new!r}"
        for name, (old, new) in pairs.items()
        if old != new and (old is None or new is None or not math.isclose(old, new, rel_tol=CLOSE))
    ]


def _digest_own(names: Iterable[str]) -> dict[str, str]:
    """Digests of those files of a study that are there."""
    return {name: digest_source(path) for name in names if (path := PIPELINES.parent / name).is_file()}


@cache
def find_model_hash(model: str) -> str:
    """The hash of an installed model of a robot; empty if it is not installed."""
    if model not in package_models():
        return ""
    machine = compose_config(["scenario=robot", f"machine={model}"]).machine
    return read_model(machine).model_hash if isinstance(machine, RobotMachine) else ""


def read_results() -> PublishedResults:
    """The results of the checkout; raises BadInput if this is none."""
    require(RESULTS_FILE.is_file(), "results", RESULTS_FILE, "does not exist; run it from a checkout")
    return PublishedResults(json.loads(RESULTS_FILE.read_text(encoding="utf-8")))


def _quotable(statement: Mapping[str, Any]) -> dict[str, Any]:
    """An entry of a statement: its verdict, and a value, an interval, n and a verdict for each criterion."""
    kind, criteria = Finding if statement["kind"] == "finding" else Claim, statement["criteria"]
    return {
        "verdict": statement["verdict"],
        "values": [each["shown"] for each in criteria],
        "intervals": [each["spread"] for each in criteria],
        "counts": [each["size"] for each in criteria],
        "verdicts": [kind.verdicts[each["verdict"]] for each in criteria],
    }


@cache
def declared() -> Mapping[str, Mapping[str, Claim | Finding]]:
    """Every statement by study and name, whether it was measured or not."""
    return {file.name: file.study.statements for file in every_study()}


def sentence_of(statement: Claim | Finding, entry: Mapping[str, Any]) -> str:
    """The sentence of a statement as it came out."""
    return statement.sentence(entry["verdict"], entry["values"], entry["intervals"], entry["counts"])


def find_entry(study: str, name: str, results: Quotable) -> Mapping[str, Any] | None:
    """What a study gave for a statement; None if it has never measured all that the statement consists of.

    Raises:
        LookupError: it declares no such statement.
    """
    count, entry = len(declared()[study][name].criteria), results.get(study, {}).get(name)
    whole = entry is not None and all(len(entry.get(column) or ()) == count for column in MEASURED)
    return entry if whole else None


def quoted(match: re.Match[str], results: Quotable) -> str:
    """What a page shows for a quote.

    Raises:
        LookupError: there is no such study, statement or value.
    """
    kind, study, name, number = match.groups()
    statement, index = declared().get(study, {}).get(name), int(number or 0)
    if statement is None or index >= len(statement.criteria):
        raise LookupError(f"{match[0]}: no study declares it")
    if (entry := find_entry(study, name, results)) is None:
        return NOT_MEASURED
    value, interval, size, _ = (str(entry[column][index]) for column in MEASURED)
    return {
        "quote": value,
        "interval": interval,
        "measured": f"{value} [{interval}]",
        "size": size,
        "verdict": str(entry["verdict"]),
        "sentence": sentence_of(statement, entry),
    }[kind]


def fill_quotes(text: str, results: Quotable) -> str:
    """A page with its quotes filled in; raises as :func:`quoted`."""
    return QUOTE.sub(partial(quoted, results=results), text)


def find_outdated(
    sentences: Sequence[Mapping[str, Any]], texts: Mapping[str, str], results: Quotable
) -> Iterator[str]:
    """Sentences that are gone from their page, or were written for another verdict; a line for each.

    Args:
        sentences: ``page``, ``text``, and the verdict that it ``needs`` by statement.
        texts: of pages, by name.
        results: of the studies.
    """
    for each in sentences:
        if each["text"] not in " ".join(texts[each["page"]].split()):
            yield f"{each['page']}: has no sentence {each['text']!r}"
        for key, verdict in each["needs"].items():
            study, _, name = key.partition(".")
            entry = find_entry(study, name, results)
            if (today := entry["verdict"] if entry else NOT_MEASURED) != verdict:
                yield f"{each['page']}: {each['text']!r} is for {key} = {verdict}, it is {today}"


def count_claims(results: Quotable) -> str:
    """How many claims of the paper have each verdict, as a sentence."""
    entries = [find_entry(file.name, name, results) for file in all_studies() for name in file.study.claims]
    return count_verdicts([entry["verdict"] for entry in entries if entry])


def renew_readme(text: str, statements: Quotable) -> str:
    """The README with its section of results, and the table of its first run, made anew."""
    section = text.partition("\n## Results\n")[2].partition("\n## ")[0]
    block = BLOCK.read_text(encoding="utf-8").replace("{{ count }}", count_claims(statements))
    text = text.replace(section, fill_quotes(block, statements))
    ((overrides, table),) = FIRST_RUN.findall(text)
    with TemporaryDirectory() as folder:
        run = cmacexp.run(overrides.split(), Path(folder, "run"))
    return text.replace(table, str(run).partition("\n")[2])
