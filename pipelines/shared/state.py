"""Whether a report is still that of the code, the configs and the runs as they are now."""

import hashlib
from collections.abc import Sequence
from pathlib import Path

from cmacexp.config import config_folder
from cmacexp.data import manifest as manifests
from cmacexp.data.integrity import faults
from cmacexp.errors import BadRun
from cmacexp.jit.sources import PACKAGE

PIPELINES = Path(__file__).resolve().parents[1]


def state_key(studies: Sequence[str], quick: bool) -> str:
    """Hash of everything besides its runs that a report depends on."""
    digest = hashlib.sha256(repr((list(studies), quick, sorted(manifests.versions().items()))).encode())
    for folder, pattern in ((PACKAGE, "*.py"), (PACKAGE, "*.html"), (PIPELINES, "*.py")):
        for file in sorted(folder.rglob(pattern)):
            digest.update(file.read_bytes())
    for file in sorted(config_folder().rglob("*.yaml")):
        digest.update(file.read_bytes())
    return digest.hexdigest()


def is_up_to_date(folder: Path, key: str) -> bool:
    """Whether the report in ``folder`` has this key, and every file that it lists is there unchanged."""
    try:
        return manifests.read(folder).get("key") == key and not faults(folder)
    except BadRun:
        return False
