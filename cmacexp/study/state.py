"""Whether a study's report is still that of the code, the configs and the runs as they are now."""

import hashlib
from pathlib import Path

from cmacexp.config import config_folder
from cmacexp.data import manifest as manifests
from cmacexp.data.integrity import faults
from cmacexp.errors import BadRun
from cmacexp.jit.sources import PACKAGE
from cmacexp.study.study import StudyFile


def state_key(file: StudyFile, quick: bool, seeds: int) -> str:
    """Hash of everything besides its runs that the report of a study depends on; other studies are not part of it."""
    digest = hashlib.sha256(repr((file.name, quick, seeds, sorted(manifests.versions().items()))).encode())
    folders = ((PACKAGE, "*.py"), (PACKAGE, "*.html"), (PACKAGE, "*.md"), (config_folder(), "*.yaml"))
    for source in [*file.sources, *(path for folder, pattern in folders for path in sorted(folder.rglob(pattern)))]:
        digest.update(source.read_bytes())
    return digest.hexdigest()


def is_up_to_date(folder: Path, key: str) -> bool:
    """Whether the report in ``folder`` has this key, and every file that it lists is there unchanged."""
    try:
        return manifests.read(folder).get("key") == key and not faults(folder)
    except BadRun:
        return False
