"""The page of the package on an index: README.md with links that work there."""

import re
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

# A link or picture of Markdown whose target is a path in the repository.
_RELATIVE = re.compile(r"(!?)(\[[^\]]*\]\()(?![a-z]+:|#)")


class IndexPage(MetadataHookInterface):
    """Gives the links of README.md the address of the tag of this version."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Set the readme; the repository's own file keeps its short links."""
        address, tag = metadata["urls"]["Repository"], f"v{metadata['version']}"

        def absolute(link: re.Match[str]) -> str:
            kind = "raw" if link[1] else "blob"
            return f"{link[0]}{address}/{kind}/{tag}/"

        text = Path(self.root, "README.md").read_text("utf-8")
        text = _RELATIVE.sub(absolute, text)
        metadata["readme"] = {"content-type": "text/markdown", "text": text}
