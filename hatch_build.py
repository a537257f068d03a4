"""Build hook: the README for a package index, where links to files lead nowhere."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

_IMAGE = re.compile(r"^!\[[^\]]*\]\((?!https?:)[^)]*\)\n+", re.MULTILINE)
_LINK = re.compile(r"\[([^\]]+)\]\((?!https?:)([^)#]*)[^)]*\)")
_HERE = re.compile(r"(?<=pip install )('?)\.(?=\s|\[)")  # the checkout
_NOTE = "Paths in parentheses are files of the source distribution.\n"


class IndexReadme(MetadataHookInterface):
    """Sets the project's readme."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Set `metadata["readme"]`."""
        text = (Path(self.root) / "README.md").read_text(encoding="utf-8")
        metadata["readme"] = {"content-type": "text/markdown", "text": index_text(text)}


def index_text(readme: str) -> str:
    """The README without relative images, with the paths of relative links as text.

    The package is installed by its name.
    """
    readme = _HERE.sub(r"\1ssiam", readme)
    title, _, rest = _IMAGE.sub("", readme).partition("\n")
    return f"{title}\n\n{_NOTE}{_LINK.sub(_as_text, rest)}"


def _as_text(link: re.Match[str]) -> str:
    text, path = link.groups()
    if not path:  # a heading of the same page
        return text
    return f"`{path}`" if text == path else f"{text} (`{path}`)"
