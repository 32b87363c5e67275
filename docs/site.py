"""Pages of the site that stand outside of docs: README as its home, the studies, changelog and security."""

import posixpath
import re
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
OUTSIDE = {
    "README.md": "index.md",
    "CHANGELOG.md": "changelog.md",
    "SECURITY.md": "security.md",
    **{
        f"pipelines/pages/{path.name}": f"studies/{path.name}" for path in (ROOT / "pipelines" / "pages").glob("*.md")
    },
}
"""Page of the site by file of the repository."""
LINK = re.compile(r"\[([^\[\]]*)\]\(([^)#:\s]+)(#[^)]*)?\)")


def find_source(page: str) -> str:
    """Return the file of the repository, of a page of the site."""
    return next((source for source, name in OUTSIDE.items() if name == page), f"docs/{page}")


def find_page(source: str) -> str | None:
    """Return the page of the site that a file of the repository is; None if the site does not contain it."""
    inside = source.removeprefix("docs/")
    return OUTSIDE.get(source) or (inside if source != inside else None)


def link_pages(text: str, page: str) -> str:
    """Change links of a file of the repository to those of its page; a link to another file becomes text."""
    folder = posixpath.dirname(find_source(page))

    def change(match: re.Match[str]) -> str:
        words, address, part = match.groups(default="")
        if (target := find_page(posixpath.normpath(posixpath.join(folder, address)))) is None:
            return words
        return f"[{words}]({posixpath.relpath(target, posixpath.dirname(page) or '.')}{part})"

    return LINK.sub(change, text)


def on_config(config: Any) -> Any:
    """Add the pages of studies at the end of the navigation's results; mkdocs calls this once."""
    (results,) = (group["Results"] for group in config.nav if "Results" in group)
    results.append({"Studies": sorted(name for name in OUTSIDE.values() if name.startswith("studies/"))})
    return config


def on_files(files: Any, config: Any) -> Any:
    """Add the pages from outside of docs; mkdocs calls this once."""
    from mkdocs.structure.files import File

    for source, name in OUTSIDE.items():
        files.append(File.generated(config, name, content=(ROOT / source).read_text(encoding="utf-8")))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Change the links of a page; mkdocs calls this for every page."""
    return link_pages(markdown, page.file.src_uri)
