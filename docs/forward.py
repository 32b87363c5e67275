"""Redirects from the addresses of pages that were merged into others."""

from pathlib import Path
from typing import Any

FORWARD: dict[str, str] = {
    "symbols": "equations#symbols",
    "quick-reference": "runs",
    "change": "runs",
    "compare-settings": "runs#compare-two-settings",
    "add-a-plant": "components#a-plant",
    "add-a-controller": "components#a-controller",
    "cmac": "components#the-cmac-without-a-leg",
    "make-a-figure": "figures#a-figure-for-a-paper",
    "look": "figures",
    "recordings": "figures#recordings",
    "other-tools": "figures#other-programs",
    "signals": "files#signals",
    "metrics": "files#metrics",
    "reproducibility": "files#the-same-results-again",
    "api": "commands#python-api",
    "how-to-choose": "long-runs#how-to-choose",
    "learning-rules": "long-runs#learning-rules",
    "to-hardware": "real-robot#the-feedforward-in-c",
    "browser": "runs",
    "studies": "add-a-study#the-studies",
    "gap": "real-robot#compare-a-log-with-a-model",
    "main-path": "contributing#the-main-path",
    "tutorial": "runs#first-ten-minutes",
    "concepts": "equations#terms",
    "questions": "runs#change-something",
    "performance": "sweeps#times",
    "reinforcement-learning": "components#stepped-from-outside-and-reinforcement-learning",
    "design-notes": "contributing#decisions",
    "use-a-urdf": "components#your-robot",
}
"""New address by old address, without ``.html``; the new one may contain a fragment: ``page#part``."""
PAGE = (
    '<!doctype html><meta charset="utf-8"><title>Moved</title><meta http-equiv="refresh" content="0; url={0}">'
    '<link rel="canonical" href="{0}"><p>This page is now <a href="{0}">here</a>.</p>\n'
)


def on_post_build(config: Any) -> None:
    """Write a redirect at every old address; mkdocs calls this once.

    Raises:
        ValueError: a page exists at an old address, or a new page or its part does not exist.
    """
    site = Path(config.site_dir)
    for old, new in FORWARD.items():
        name, _, fragment = new.partition("#")
        page, target = site / f"{old}.html", site / f"{name}.html"
        if (
            page.exists()
            or not target.exists()
            or f'id="{fragment}"' not in f'id=""{target.read_text(encoding="utf-8")}'
        ):
            raise ValueError(f"docs/forward.py: {old}: {new} is no page or part of one, or {old} is one still")
        page.write_text(PAGE.format(f"{name}.html#{fragment}".removesuffix("#")), encoding="utf-8")
