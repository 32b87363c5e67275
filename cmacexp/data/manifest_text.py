"""The text of a manifest, which ends with the checksum of what is before it."""

import hashlib
import json
from typing import Any

NAME = "manifest.json"
CHECKSUM = "checksum"
"""Entry with the SHA-256 of all other entries; earlier versions wrote none."""


def dump(manifest: dict[str, Any]) -> str:
    """The text of a manifest."""
    content = {key: value for key, value in manifest.items() if key != CHECKSUM}
    checksum = hashlib.sha256(json.dumps(content, indent=2).encode()).hexdigest()
    return json.dumps({**content, CHECKSUM: checksum}, indent=2) + "\n"
