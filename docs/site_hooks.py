"""Brings the pages into the site that lie beside what they describe, and points links at them.

The cards of data and weights are read where data and weights are; the site shows them as pages of its own.
Examples run where they lie; the site shows their source below the command that starts them.
"""

from __future__ import annotations

import posixpath
import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

PAGES = {
    "data/README.md": "data-card.md",
    "src/ffhnet/weights/README.md": "model-card.md",
    "CHANGELOG.md": "changelog.md",
}
"""Places in the repository, and the pages of the site that show them."""

_STARTS_EXAMPLE = re.compile(r"^```\npython (examples/\S+)\n```\n", re.MULTILINE)

_LINK = re.compile(r"(?<=\]\()([^)#\s]+)")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Adds the pages that do not lie in docs."""
    root = Path(config.config_file_path).parent
    for source, page in PAGES.items():
        text = (root / source).read_text(encoding="utf-8")
        files.append(File.generated(config, page, content=_relinked(text, posixpath.dirname(source))))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Shows examples, and points links that leave docs/ at the pages that show what they mean."""
    if page.file.src_uri in PAGES.values():
        return markdown
    root = Path(config.config_file_path).parent
    markdown = _STARTS_EXAMPLE.sub(
        lambda start: f"{start[0]}\n```python\n{(root / start[1]).read_text(encoding='utf-8')}```\n", markdown
    )
    return _relinked(markdown, posixpath.join("docs", posixpath.dirname(page.file.src_uri)))


def _relinked(text: str, folder: str) -> str:
    """The text with its links into the repository made links of the site; `folder` is where the text lies."""

    def relink(match: re.Match[str]) -> str:
        place = posixpath.normpath(posixpath.join(folder, match[1]))
        for source, page in PAGES.items():
            if place in (source, posixpath.dirname(source)):
                return page
        inside = place.startswith("docs/") and not folder.startswith("docs")
        return place.removeprefix("docs/") if inside else match[1]

    return _LINK.sub(relink, text)
