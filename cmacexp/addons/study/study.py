"""The declaration of a study: what it runs, measures and says; and how it is found in its file."""

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from cmacexp.addons.study.results import Measures, Results
from cmacexp.addons.study.statements import Claim, Finding
from cmacexp.errors import BadInput, require
from cmacexp.typing import DataFrame as DataFrame
from cmacexp.typing import Figure as Figure

Values = Mapping[str, Sequence[Any] | Mapping[str, Sequence[str]]]


@dataclass(frozen=True)
class Request:
    """One run, or one for each seed."""

    overrides: tuple[str, ...]
    """As on the command line."""
    labels: Mapping[str, Any] = field(default_factory=dict, compare=False)
    """Names that the study gives to bundles of overrides: columns of the table of results."""
    seeded: bool = False
    """Whether it is, or is to be, repeated for each seed of the study."""
    starts_from: "Request | None" = None
    """Another request, whose final weights this one starts from; it is run first, with the same seed."""

    def with_seed(self, seed: int) -> "Request":
        """The run of one seed; raises BadInput if it is to be repeated for each, and sets one."""
        if self.seeded and (own := [text for text in self.overrides if text.startswith("seed=")]):
            raise BadInput("seeds", "true", f"repeats the runs for each seed; leave it out, or {own[0]}")
        before = self.starts_from.with_seed(seed) if self.starts_from else None
        overrides = (*self.overrides, f"seed={seed}") if self.seeded else self.overrides
        return replace(self, overrides=overrides, starts_from=before)


def _choices(
    key: str, values: Sequence[Any] | Mapping[str, Sequence[str]]
) -> list[tuple[tuple[str, ...], dict[str, Any]]]:
    if isinstance(values, Mapping):
        return [(tuple(bundle), {key: name}) for name, bundle in values.items()]
    return [((f"{key}={value}",), {}) for value in values]


def grid(*overrides: str, over: Values | None = None, seeded: bool = False, **labels: Any) -> list[Request]:
    """A request for every combination of values.

    Args:
        overrides: common to all.
        over: values by config key; or, by a name that is a column of the results, bundles of overrides by label.
        seeded: whether each is repeated for every seed of the study.
        labels: columns with the same value in all of these runs.

    Examples:
        >>> [request.overrides for request in grid("cycles=9", over={"cmac.layers": [8, 16]})]
        [('cycles=9', 'cmac.layers=8'), ('cycles=9', 'cmac.layers=16')]
        >>> ramps = {"none": [], "slow": ["gait.load_ramp=0.2"]}
        >>> for request in grid(over={"seed": [1, 2], "ramp": ramps}, machine="leg"):
        ...     print(request.overrides, request.labels)
        ('seed=1',) {'machine': 'leg', 'ramp': 'none'}
        ('seed=1', 'gait.load_ramp=0.2') {'machine': 'leg', 'ramp': 'slow'}
        ('seed=2',) {'machine': 'leg', 'ramp': 'none'}
        ('seed=2', 'gait.load_ramp=0.2') {'machine': 'leg', 'ramp': 'slow'}
    """
    requests = []
    for chosen in itertools.product(*(_choices(key, values) for key, values in (over or {}).items())):
        own = itertools.chain(overrides, *(texts for texts, _ in chosen))
        names = dict(itertools.chain(labels.items(), *(label.items() for _, label in chosen)))
        requests.append(Request(tuple(own), names, seeded))
    return requests


def starting_from(before: Sequence[Request], after: Sequence[Request]) -> list[Request]:
    """``after``, each starting from the weights that the request of ``before`` with its labels ends with.

    Raises:
        BadInput: not exactly one request of ``before`` has no labels but those of a request of ``after``.
    """
    return [replace(request, starts_from=_predecessor(before, request)) for request in after]


def _predecessor(before: Sequence[Request], request: Request) -> Request:
    found = [each for each in before if each.labels.items() <= request.labels.items()]
    require(
        len(found) == 1,
        "labels",
        dict(request.labels),
        f"must match one request to start from, not {len(found)}; name bundles of overrides with labels",
    )
    return found[0]


@dataclass(frozen=True, kw_only=True)
class Study:
    """What is run, measured, claimed, found and drawn; the page beside its file says what it means.

    Everything but ``runs`` is a function of the results, and is called when they are complete.
    """

    title: str
    question: str
    """What it asks, in a sentence; not what it answers."""
    runs: Callable[[bool], Sequence[Request]]
    """The runs, given whether it is to be quick."""
    measures: Measures = field(default_factory=dict)
    """Measures of a run besides its metrics: columns of the table of results."""
    computed: Mapping[str, Callable[[Results], DataFrame]] = field(default_factory=dict)
    """Tables that are computed besides the runs, and kept beside the page."""
    claims: Mapping[str, Claim] = field(default_factory=dict)
    findings: Mapping[str, Finding] = field(default_factory=dict)
    figures: Mapping[str, Callable[[Results], Figure]] = field(default_factory=dict)
    tables: Mapping[str, Callable[[Results], DataFrame]] = field(default_factory=dict)
    values: Callable[[Results], Mapping[str, Any]] = lambda results: {}
    """Further values of the page, by name."""

    @property
    def statements(self) -> Mapping[str, Claim | Finding]:
        """Claims, then findings."""
        return {**self.claims, **self.findings}
