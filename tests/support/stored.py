"""Runs that the tests share: each is made once for a state of the code, and read by whoever needs it."""

import hashlib
import os
import shutil
import tempfile
from pathlib import Path

import cmacexp

PACKAGE = Path(cmacexp.__file__).parent


def sources_digest() -> str:
    """Hash of the package and its configs, 16 hexadecimal digits: what a stored run and its recording depend on."""
    digest = hashlib.sha256()
    for folder in (PACKAGE, PACKAGE.parent / "conf"):
        for path in sorted(path for path in folder.rglob("*") if path.suffix in {".py", ".yaml"}):
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def runs_folder(config) -> Path:
    """The folder of the shared runs of this state of the code; those of other states are removed."""
    name, shared = sources_digest(), Path(config.cache.mkdir("runs"))
    for old in shared.iterdir():
        if old.name != name:
            shutil.rmtree(old, ignore_errors=True)
    folder = shared / name
    folder.mkdir(exist_ok=True)
    return folder


def make_stored(folder: Path, overrides: tuple[str, ...]) -> cmacexp.Run:
    """The run of a command line below ``folder``, which appears by one rename: another process may make it too."""
    place = folder / hashlib.sha256("\n".join(overrides).encode()).hexdigest()[:16]
    if not place.exists():
        made = Path(tempfile.mkdtemp(dir=folder, prefix=".new-"))
        cmacexp.run([*overrides, "warn=false"], made / "run")
        try:
            os.rename(made / "run", place)
        except OSError:
            if not place.exists():
                raise
        shutil.rmtree(made)
    return cmacexp.load(place)
