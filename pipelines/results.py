"""``docs/results.json``: results of the last full run of every study, their state, and quotes of them in tables.

The file holds for each study: date, version, seeds, hashes of models and code, two witnesses, and statements with
value, interval and n. Digests of the package's files are stored once for all studies that ran on the same files. The
file also lists the sentences of pages that presuppose a verdict.

``{{ quote("one_leg_learning.bias") }}`` in a template of ``docs/templates`` is the first value of a statement,
``quote("...", 1)`` the second, ``interval`` for its interval, ``measured`` for both, with n if it is small, ``size``
for its n, ``verdict`` for the verdict, ``sentence`` for the sentence of a finding. ``docs/blocks.py`` fills them in.
"""

import hashlib
import json
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from functools import cache, cached_property, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import cmacexp
from cmacexp.addons.study.interval import FEW
from cmacexp.addons.study.page import CLAIMS, count_verdicts
from cmacexp.addons.study.provenance import PROVENANCE, digest_package, digest_source, list_changed, make_witness
from cmacexp.addons.study.statements import MEASURED, NO, UNCLEAR, VERDICTS, YES, Claim, Finding
from cmacexp.addons.study.stored_rows import STORED_ROWS, judge_again
from cmacexp.config.compose import compose_config
from cmacexp.config.machine import RobotMachine, read_model
from cmacexp.errors import require
from cmacexp.models.robot_file import package_models
from pipelines.groups import PIPELINES, all_studies, every_study

DOCS = PIPELINES.parent / "docs"
README = PIPELINES.parent / "README.md"
RESULTS_FILE = DOCS / "results.json"
SCORES = {
    name: PIPELINES / "benchmark" / f"{table}.md"
    for name, table in (("benchmark", "scores"), ("log_track", "log_scores"))
}
"""Files with the tables of the last full benchmark and of its log track, by study."""
PAGES = (README, *sorted(DOCS.glob("*.md")))
"""Pages with generated blocks."""
STORED_RUNS = PIPELINES / "witnesses"
"""Folder of the stored runs of each study, from which its statements are judged again."""
QUOTE = re.compile(r'\{\{ (quote|interval|measured|size|verdict|sentence)\("(\w+)\.([^"]+)"(?:, (\d+))?\) \}\}')
NOT_MEASURED = "not measured yet"
ORDER = (*VERDICTS, YES, NO, UNCLEAR, NOT_MEASURED)
"""Verdicts in the order in which they are counted."""
CURRENT, EQUAL, CHANGED, NEVER = "current", "equal", "changed", "never run"
"""States of a study. EQUAL: its files changed, but its witnesses gave equal values with the present files."""
CLOSE = 1e-9
"""Largest relative difference of values that count as equal; the last digits differ between processors."""
Quotable = Mapping[str, Mapping[str, Any]]
"""Statements by study and name."""


class State(NamedTuple):
    """State of the stored results of a study relative to its present code."""

    state: str
    """One of CURRENT, EQUAL, CHANGED and NEVER."""
    date: str = ""
    """Date of the last full run."""
    reasons: Sequence[str] = ()
    """Files and models that have changed since the last full run."""
    confirmed: str = ""
    """Date on which the witnesses of an EQUAL study ran with the present files."""


class PublishedResults:
    """The content of ``docs/results.json``."""

    def __init__(self, entries: Mapping[str, Any]):
        self.code: dict[str, dict[str, str]] = dict(entries.get("code", {}))
        """Sets of file digests, by the hash of the set."""
        self.studies: dict[str, dict[str, Any]] = dict(entries.get("studies", {}))
        self.sentences: list[dict[str, Any]] = list(entries.get("sentences", []))
        """Sentences of pages: ``page``, ``text``, and the verdicts that it ``needs``, by statement."""

    @property
    def statements(self) -> Quotable:
        """The statements of all studies, by study and name."""
        return {name: study["statements"] for name, study in self.studies.items()}

    def add_studies(self, folder: Path) -> None:
        """Add the results of every full study below ``folder``, each read from the study's own folder.

        Folders of groups of studies are skipped.
        """
        for path in sorted(folder.glob(f"*/{CLAIMS}")):
            name = path.parent.name
            statements = json.loads(path.read_text(encoding="utf-8"))
            if name in statements:
                provenance = json.loads(path.with_name(PROVENANCE).read_text(encoding="utf-8"))[name]
                self.studies[name] = {
                    **provenance,
                    "code": self._add_code(provenance["code"]),
                    "statements": {statement["name"]: _quotable(statement) for statement in statements[name]},
                }

    def _add_code(self, files: dict[str, str]) -> str:
        """Store a set of file digests and return its key."""
        key = hashlib.sha256(json.dumps(files, sort_keys=True).encode()).hexdigest()[:12]
        self.code[key] = files
        return key

    def confirm(self, name: str) -> list[str]:
        """Rerun the witnesses of a study and judge its stored runs again; without differences, note that.

        Witnesses are two runs of a study; they do not confirm its other runs. Returns the differences. The log track
        has no runs, so it cannot be confirmed.
        """
        study = self.studies[name]
        differing = [line for witness in study["witnesses"] for line in repeat_witness(witness)]
        differing += judge_stored(name)
        if study["witnesses"] and not differing:
            study["confirmed"] = {
                "date": datetime.now(UTC).date().isoformat(),
                "code": self._add_code(digest_package()),
                "own": _digest_own(study["own"]),
            }
        return differing

    def format(self) -> str:
        """Return the text of the file, without digests that no study needs any more."""
        used = {entry["code"] for study in self.studies.values() for entry in (study, study.get("confirmed", study))}
        code = {key: files for key, files in self.code.items() if key in used}
        entries = {"code": code, "studies": dict(sorted(self.studies.items())), "sentences": self.sentences}
        return json.dumps(entries, indent=1, ensure_ascii=False) + "\n"

    def find_state(self, name: str) -> State:
        """Determine the state of the stored results of a study."""
        if (study := self.studies.get(name)) is None:
            return State(NEVER)
        changed = self._list_changed(study)
        confirmed = study.get("confirmed")
        if changed and confirmed and not self._list_changed(confirmed):
            return State(EQUAL, study["date"], changed, confirmed["date"])
        models = {} if changed else study["models"]  # reading models takes long, and could only add reasons
        differ = [f"model of {name}" for name, old in models.items() if find_model_hash(name) not in ("", old)]
        return State(CHANGED if changed or differ else CURRENT, study["date"], [*changed, *differ])

    @cached_property
    def _package(self) -> dict[str, str]:
        """Digests of the present files of the package."""
        return digest_package()

    def _list_changed(self, digests: Mapping[str, Any]) -> list[str]:
        """List the files of the package and of a study that differ from stored digests."""
        package = list_changed(self.code[digests["code"]], self._package)
        return [*package, *list_changed(digests["own"], _digest_own(digests["own"]))]


def renew_stored_rows(folder: Path) -> None:
    """Copy the stored runs of every full study below ``folder`` to ``STORED_RUNS``, else those of a short one."""
    for name in declared():
        target = STORED_RUNS / f"{name}.json"
        for kind in ("", "-one-seed", "-quick"):
            path = folder / f"{name}{kind}" / STORED_ROWS
            if path.is_file() and not (kind and target.exists()):
                text = path.read_text(encoding="utf-8")
                if json.loads(text)["statements"]:
                    target.write_text(text, encoding="utf-8")


def judge_stored(name: str) -> list[str]:
    """Judge the statements of a study on its stored runs, if it has any; returns those that give something else."""
    path = STORED_RUNS / f"{name}.json"
    return judge_again(path, declared()[name]) if path.is_file() else []


def run_witness(overrides: Sequence[str]) -> dict[str, Any]:
    """Run a witness and return its entry: the overrides, and the metrics of the last whole cycle."""
    with TemporaryDirectory() as folder:
        return make_witness(overrides, cmacexp.run([*overrides, "record=metrics", "warn=false"], Path(folder, "run")))


def repeat_witness(witness: Mapping[str, Any]) -> list[str]:
    """Rerun a witness and list the metrics of its last whole cycle that differ, with old and new value."""
    expected = witness["metrics"]
    actual = run_witness(witness["overrides"])["metrics"]
    pairs = {name: (expected.get(name), actual.get(name)) for name in sorted({*expected, *actual})}
    return [
        f"{' '.join(witness['overrides'])}: {name} was {old!r}, is {new!r}"
        for name, (old, new) in pairs.items()
        if old != new and (old is None or new is None or not math.isclose(old, new, rel_tol=CLOSE))
    ]


def _digest_own(names: Iterable[str]) -> dict[str, str]:
    """Compute the digests of the existing files of a study, by name."""
    return {name: digest_source(path) for name in names if (path := PIPELINES.parent / name).is_file()}


@cache
def find_model_hash(model: str) -> str:
    """Return the hash of an installed robot model; an empty string if it is not installed."""
    if model not in package_models():
        return ""
    machine = compose_config(["scenario=robot", f"machine={model}"]).machine
    return read_model(machine).model_hash if isinstance(machine, RobotMachine) else ""


def read_results() -> PublishedResults:
    """Read ``docs/results.json``.

    Raises:
        BadInput: the file is missing, as outside a checkout.
    """
    require(RESULTS_FILE.is_file(), "results", RESULTS_FILE, "does not exist; run it from a checkout")
    return PublishedResults(json.loads(RESULTS_FILE.read_text(encoding="utf-8")))


def _quotable(statement: Mapping[str, Any]) -> dict[str, Any]:
    """Return the entry of a statement: its verdict, and value, interval, n and verdict of each criterion."""
    criteria = statement["criteria"]
    verdicts = (Finding if statement["kind"] == "finding" else Claim).verdicts
    return {
        "verdict": statement["verdict"],
        "values": [criterion["shown"] for criterion in criteria],
        "intervals": [criterion["spread"] for criterion in criteria],
        "counts": [criterion["size"] for criterion in criteria],
        "verdicts": [verdicts[criterion["verdict"]] for criterion in criteria],
    }


@cache
def declared() -> Mapping[str, Mapping[str, Claim | Finding]]:
    """Return every declared statement by study and name, measured or not."""
    return {file.name: file.study.statements for file in every_study()}


def sentence_of(statement: Claim | Finding, entry: Mapping[str, Any]) -> str:
    """Return the sentence of a statement with its measured verdict and values."""
    return statement.sentence(entry["verdict"], entry["values"], entry["intervals"], entry["counts"])


def find_entry(study: str, name: str, results: Quotable) -> Mapping[str, Any] | None:
    """Return the stored entry of a statement; None unless all of its criteria have been measured.

    Raises:
        LookupError: the study declares no such statement.
    """
    count = len(declared()[study][name].criteria)
    entry = results.get(study, {}).get(name)
    whole = entry is not None and all(len(entry.get(column) or ()) == count for column in MEASURED)
    return entry if whole else None


def quoted(match: re.Match[str], results: Quotable) -> str:
    """Return the text that a page shows for a quote.

    Raises:
        LookupError: there is no such study, statement or value.
    """
    kind, study, name, number = match.groups()
    statement = declared().get(study, {}).get(name)
    index = int(number or 0)
    if statement is None or index >= len(statement.criteria):
        raise LookupError(f"{match[0]}: no study declares it")
    if (entry := find_entry(study, name, results)) is None:
        return NOT_MEASURED
    value, interval, size, _ = (str(entry[column][index]) for column in MEASURED)
    of_few = f", n = {size}" if int(size.split()[-1]) < FEW else ""
    return {
        "quote": value,
        "interval": interval,
        "measured": f"{value} [{interval}{of_few}]",
        "size": size,
        "verdict": str(entry["verdict"]),
        "sentence": sentence_of(statement, entry),
    }[kind]


def fill_quotes(text: str, results: Quotable) -> str:
    """Fill in the quotes of a page; raises as :func:`quoted`."""
    return QUOTE.sub(partial(quoted, results=results), text)


def find_outdated(
    sentences: Sequence[Mapping[str, Any]], texts: Mapping[str, str], results: Quotable
) -> Iterator[str]:
    """Yield a line for each sentence that is gone from its page, or that presupposes another verdict.

    Args:
        sentences: ``page``, ``text``, and the verdicts that it ``needs``, by statement.
        texts: pages by name.
        results: statements of the studies.
    """
    for sentence in sentences:
        if sentence["text"] not in " ".join(texts[sentence["page"]].split()):
            yield f"{sentence['page']}: has no sentence {sentence['text']!r}"
        for key, verdict in sentence["needs"].items():
            study, _, name = key.partition(".")
            entry = find_entry(study, name, results)
            if (today := entry["verdict"] if entry else NOT_MEASURED) != verdict:
                yield f"{sentence['page']}: {sentence['text']!r} is for {key} = {verdict}, it is {today}"


def count_outcomes(verdicts: Sequence[str]) -> str:
    """Count statements by verdict, e.g. ``3 yes, 1 no``."""
    return ", ".join(f"{verdicts.count(verdict)} {verdict}" for verdict in sorted({*verdicts}, key=ORDER.index))


def count_claims(results: Quotable) -> str:
    """Count the paper's claims by verdict, as a sentence."""
    entries = [find_entry(file.name, name, results) for file in all_studies() for name in file.study.claims]
    return count_verdicts([entry["verdict"] for entry in entries if entry])
