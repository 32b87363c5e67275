"""``docs/results.json``: what every study gave when it last ran in full, what its values depend on, and its state.

The file holds, by study, date, version, seeds, hashes of models and code, two witnesses, and statements with value,
interval and n; digests of the package's files once for all studies that ran on the same ones; and the sentences of
pages that were written for one verdict.
"""

import hashlib
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import cmacexp
from cmacexp.config.compose import compose_config
from cmacexp.config.machine import RobotMachine, read_model
from cmacexp.errors import BadInput
from cmacexp.models.robot_file import package_models
from cmacexp.study.page import CLAIMS
from cmacexp.study.provenance import PROVENANCE, digest_package, digest_source, list_changed, make_witness
from cmacexp.study.statements import OUTCOMES
from pipelines.benchmark.benchmark import BENCHMARK
from pipelines.benchmark.log_track import NAME as LOG_TRACK
from pipelines.groups import PIPELINES
from pipelines.quotes import DOCS, Quotable

RESULTS_FILE = DOCS / "results.json"
CURRENT, EQUAL, CHANGED, NEVER = "current", "equal", "changed", "never run"
"""EQUAL: its files changed, and its witnesses gave the same values on the files of today."""
CLOSE = 1e-9
"""Relative difference of equal values; the last digits differ between processors."""


class State(NamedTuple):
    """Whether what a study gave still is what its code gives."""

    study: str
    state: str
    """One of CURRENT, EQUAL, CHANGED and NEVER."""
    date: str
    """Of the last full run."""
    reasons: Sequence[str]
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
            name, beside = path.parent.name, path.with_name(PROVENANCE)
            statements = _read(path).get(name)
            if statements is None or not beside.is_file():
                continue
            provenance = _read(beside)[name]
            key = self._add_code(provenance.pop("code"))
            own = {each["name"]: _quotable(each) for each in statements}
            self.studies[name] = {**provenance, "code": key, "statements": own}

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
            known = {"code": self._add_code(digest_package()), "own": _digest_own(study["own"])}
            study["confirmed"] = {"date": datetime.now(UTC).date().isoformat(), **known}
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
            return State(name, NEVER, "", [])
        changed = self._list_changed(study)
        known = {} if changed else study["models"]  # reading models takes long, and could only add reasons
        models = [
            f"model of {model}" for model, digest in known.items() if find_model_hash(model) not in ("", digest)
        ]
        again = study.get("confirmed")
        if changed and again and not self._list_changed(again):
            return State(name, EQUAL, study["date"], changed, again["date"])
        return State(name, CHANGED if changed or models else CURRENT, study["date"], [*changed, *models])

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
    paths = {name: PIPELINES.parent / name for name in names}
    return {name: digest_source(path) for name, path in paths.items() if path.is_file()}


@cache
def find_model_hash(model: str) -> str:
    """The hash of an installed model of a robot; empty if it is not installed."""
    if model not in package_models():
        return ""
    machine = compose_config(["scenario=robot", f"machine={model}"]).machine
    return read_model(machine).model_hash if isinstance(machine, RobotMachine) else ""


def _read(path: Path) -> Any:
    return json.loads(path.read_text(encoding="utf-8"))


def read_results() -> PublishedResults:
    """The results of the checkout; raises BadInput if this is none."""
    if not RESULTS_FILE.is_file():
        raise BadInput("results", RESULTS_FILE, "does not exist; run it from a checkout")
    return PublishedResults(_read(RESULTS_FILE))


def list_states(results: PublishedResults) -> list[State]:
    """The state of every study, of the benchmark, and of its log track."""
    studies = [path.stem for path in sorted(PIPELINES.glob("*.md"))]
    return [results.find_state(name) for name in [*studies, BENCHMARK, LOG_TRACK]]


def _quotable(statement: Mapping[str, Any]) -> dict[str, Any]:
    """An entry of a statement: its verdict, and a value, an interval, n and a verdict for each criterion."""
    words, criteria = OUTCOMES if statement["kind"] == "finding" else {}, statement["criteria"]
    return {
        "verdict": statement["verdict"],
        "values": [each["shown"] for each in criteria],
        "intervals": [each["spread"] for each in criteria],
        "counts": [each["size"] for each in criteria],
        "verdicts": [words.get(each["verdict"], each["verdict"]) for each in criteria],
    }
