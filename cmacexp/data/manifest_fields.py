"""Entries of a manifest, declared like the fields of a config, and the check of the config in a manifest."""

from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields
from pathlib import PurePosixPath
from typing import Any

from cmacexp.config import config_hash, to_plain
from cmacexp.config.component import COMPONENTS
from cmacexp.config.fields import choice, number, read_fields
from cmacexp.config.machine import LEG_KEYS, MACHINES
from cmacexp.data.records import MOST, CarriedLoad, Drift, DroppedSensor, GuardEvent, LeadEstimate, MemoryUse
from cmacexp.errors import require, require_name
from cmacexp.models.chain import CHAIN_FIELDS
from cmacexp.typing import ENDS, RESULTS

REPORT, SWEEP = "report", "sweep"
"""Kinds of manifests other than that of a run, which has no entry ``kind``."""
READ = (
    "scenario",
    "sampling_period",
    "cycles",
    "gait.cycle_time",
    "terrain.stiffness",
    "terrain.slope",
    "terrain.slope_start",
    "machine.hip_height",
    "learning.start_cycle",
    "record.every_nth_step",
    "record.cycles",
    *(f"{group}._target_" for group in COMPONENTS),
)
"""Keys of the config of a stored run that views and tables read."""


@dataclass
class RobotGeometry:
    """Geometry of the legs of a robot, for views of its trace; raises BadInput unless it is for four legs."""

    chains: list[list[float]] = number("m")
    """Kinematic chain of each leg, lengths in m, see :mod:`cmacexp.models.chain`."""
    hips: list[list[float]] = number("m")
    """Position of each hip in the body frame, (forward, left)."""
    foot_radius: float = number("m")

    def __post_init__(self) -> None:
        for name, rows, size in (("chains", self.chains, CHAIN_FIELDS), ("hips", self.hips, 2)):
            fits = [len(row) for row in rows] == [size] * len(LEG_KEYS)
            require(fits, f"robot.{name}", rows, f"must have {size} numbers for each of {len(LEG_KEYS)} legs")


@dataclass
class SweepManifest:
    """Manifest of a sweep."""

    status: str
    config: dict[str, Any]
    """``record.trace`` only, which is false if some jobs keep no traces; empty otherwise."""
    files: dict[str, str]
    """SHA-256 of the tables of the jobs without folders, by file name."""


@dataclass(kw_only=True)
class RunManifest:
    """Manifest of a run; manifests of earlier versions can lack the entries that have a default."""

    status: str = choice(*ENDS)
    cause: str | None
    """Why it did not complete; empty if it did."""
    seed: Any
    config: dict[str, Any]
    """Config as plain dictionaries; if the run took no step, possibly incomplete."""
    config_hash: str
    """Hash of the fields of the config that affect results, see :func:`cmacexp.config.config_hash`."""
    versions: dict[str, str]
    """Versions of this package, of Python, and of the packages on which results can depend."""
    git_commit: str | None
    """Commit of the Git checkout that ran it; None if the package was installed."""
    steps: int = number("", at_least=0, at_most=MOST)
    """Number of sampling periods simulated."""
    rollout_seconds: float = number("s", at_least=0)
    """Wall time of the closed loop only, without compilation."""
    wall_seconds: float = number("s", at_least=0)
    """Wall time of the whole run."""
    files: dict[str, str]
    """SHA-256 of the files of the run, by file name."""
    dropped: list[DroppedSensor] = field(default_factory=list)
    """Force sensors that fault detection switched off."""
    memory: list[MemoryUse] = field(default_factory=list)
    """Memory use of the network of each leg; empty if nothing learns."""
    drift: Drift | None = None
    """First drift detected, with the growth of the feedback in the last cycle."""
    processor_seconds: float | None = number("s", at_least=0, default=None)
    """Processor time of the closed loop, summed over all cores."""
    guard: list[GuardEvent] = field(default_factory=list)
    lead_estimates: list[LeadEstimate] = field(default_factory=list)
    learning_lead: int | None = number("samples", default=None)
    """Lead of learning that resulted from ``learning.lead``."""
    learning_rate: float | None = number("", default=None)
    """Learning rate that resulted from ``learning.rate``."""
    carried: list[CarriedLoad] = field(default_factory=list)
    code_hash: str | None = None
    """Hash of the code of this package on which results depend."""
    custom_code: str | None = None
    """Hash of the code of custom components; None without any."""
    start_weights: str | None = None
    """SHA-256 of the weights that learning started from; None if they were zero."""
    model_hash: str | None = None
    """Hash of the model of the robot; None for other machines."""
    robot: RobotGeometry | None = None
    plant: Any = None
    """Report of the plant on the run, see :class:`cmacexp.protocols.Plant`."""
    overrides: list[str] | None = None
    """Overrides that the config was composed from; None if the run was started with a complete config."""
    traceback: str = ""
    """Traceback of an error other than bad input; else empty."""
    bad_input: bool | None = None
    """True if bad input prevented the run, False if another error did; None if it ran."""


def fill_entries(entries: Mapping[str, Any]) -> dict[str, Any]:
    """Add the defaults of missing entries to the manifest of a run that was checked when it was written."""
    return {item.name: [] if item.default is MISSING else item.default for item in fields(RunManifest)} | {**entries}


def complete(plain: Any) -> dict[str, Any]:
    """Check the manifest ``plain``, as read from its file, and add the defaults of missing entries.

    The entries are those of :class:`RunManifest`, or of :class:`SweepManifest` for a sweep; unknown ones, as of later
    versions, are kept. Raises BadInput if an entry is missing or invalid.
    """
    require(isinstance(plain, dict), "manifest", plain, "must be an object")
    kind = plain.get("kind")
    if kind == REPORT:  # only its files are read
        require(isinstance(plain.get("files", {}), dict), "files", plain.get("files"), "must be an object")
        return dict(plain)
    schema = SweepManifest if kind == SWEEP else RunManifest
    names = [entry.name for entry in fields(schema)]
    manifest: Any = read_fields(schema, {name: plain[name] for name in names if name in plain}, texts=False)
    for name in manifest.files:
        is_inside = name and PurePosixPath(name).name == name and "\0" not in name
        require(is_inside, "files", name, "must be names of files in its folder")
    if isinstance(manifest, RunManifest):
        is_unchanged = manifest.config_hash == config_hash(manifest.config)
        require(is_unchanged, "config", "(changed)", "is not the one of its config_hash")
        if manifest.files or manifest.steps or manifest.status in RESULTS:  # else the config may be incomplete
            _require_keys(manifest.config)
    return {**plain, **to_plain(manifest)}


def _require_keys(config: Mapping[str, Any]) -> None:
    """Require the keys that are read without simulating, see :data:`READ`, which earlier versions may lack."""
    for key in READ:
        group, _, name = key.rpartition(".")
        node: Any = config.get(group) if group else config
        require(isinstance(node, dict) and name in node, f"config.{key}", "(not set)", "must have a value")
    require_name("config.machine.kind", config["machine"].get("kind"), tuple(MACHINES))
