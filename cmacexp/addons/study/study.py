"""The declaration of a study: its runs, measures, statements, figures and tables."""

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
    """A run, or one run per seed."""

    overrides: tuple[str, ...]
    """Config overrides as on the command line."""
    labels: Mapping[str, Any] = field(default_factory=dict, compare=False)
    """Labels of the run, such as names of groups of overrides: columns of the table of results."""
    seeded: bool = False
    """True if the run is repeated for each seed of the study."""
    starts_from: "Request | None" = None
    """Request whose final weights this run starts from; that request is run first, with the same seed."""

    def with_seed(self, seed: int) -> "Request":
        """Return the request for one seed.

        Raises:
            BadInput: the request is seeded, but its overrides set a seed, too.
        """
        if self.seeded and (seeds := [text for text in self.overrides if text.startswith("seed=")]):
            raise BadInput("seeds", "true", f"repeats the runs for each seed; leave it out, or {seeds[0]}")
        predecessor = self.starts_from.with_seed(seed) if self.starts_from else None
        overrides = (*self.overrides, f"seed={seed}") if self.seeded else self.overrides
        return replace(self, overrides=overrides, starts_from=predecessor)


def _choices(
    key: str, values: Sequence[Any] | Mapping[str, Sequence[str]]
) -> list[tuple[tuple[str, ...], dict[str, Any]]]:
    if isinstance(values, Mapping):
        return [(tuple(bundle), {key: name}) for name, bundle in values.items()]
    return [((f"{key}={value}",), {}) for value in values]


def grid(*overrides: str, over: Values | None = None, seeded: bool = False, **labels: Any) -> list[Request]:
    """Make a request for every combination of values.

    Args:
        overrides: overrides of all runs.
        over: values by config key; or lists of overrides by label, under a name that is a column of the results.
        seeded: true if each run is repeated for every seed of the study.
        labels: columns of the results with the same value in all of these runs.

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
        run_overrides = itertools.chain(overrides, *(texts for texts, _ in chosen))
        names = dict(itertools.chain(labels.items(), *(label.items() for _, label in chosen)))
        requests.append(Request(tuple(run_overrides), names, seeded))
    return requests


def starting_from(before: Sequence[Request], after: Sequence[Request]) -> list[Request]:
    """Make each request of ``after`` start from the final weights of a request of ``before``.

    The request to start from is the one whose labels all occur, with equal values, in the later request.

    Raises:
        BadInput: none or several requests of ``before`` match a request of ``after``.
    """
    return [replace(request, starts_from=_predecessor(before, request)) for request in after]


def _predecessor(before: Sequence[Request], request: Request) -> Request:
    matches = [earlier for earlier in before if earlier.labels.items() <= request.labels.items()]
    require(
        len(matches) == 1,
        "labels",
        dict(request.labels),
        f"must match one request to start from, not {len(matches)}; name bundles of overrides with labels",
    )
    return matches[0]


@dataclass(frozen=True, kw_only=True)
class Study:
    """Runs, measures, claims, findings, figures and tables; the page beside the file discusses them.

    Tables, figures and values are functions of the results, called when all runs are complete.
    """

    title: str
    question: str
    """The question of the study, in one sentence, without its answer."""
    runs: Callable[[bool], Sequence[Request]]
    """Function that returns the runs; its argument is true for a quick study."""
    measures: Measures = field(default_factory=dict)
    """Further measures of a run, by name, besides its metrics: columns of the table of results."""
    computed: Mapping[str, Callable[[Results], DataFrame]] = field(default_factory=dict)
    """Functions that compute further tables from the results, by name; the tables are stored beside the page."""
    claims: Mapping[str, Claim] = field(default_factory=dict)
    findings: Mapping[str, Finding] = field(default_factory=dict)
    figures: Mapping[str, Callable[[Results], Figure]] = field(default_factory=dict)
    tables: Mapping[str, Callable[[Results], DataFrame]] = field(default_factory=dict)
    values: Callable[[Results], Mapping[str, Any]] = lambda results: {}
    """Function that computes further values of the page, by name."""

    @property
    def statements(self) -> Mapping[str, Claim | Finding]:
        """Claims, then findings, by name."""
        return {**self.claims, **self.findings}
