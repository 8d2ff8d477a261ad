"""Documents of the repository's top folder as pages of the site."""

from __future__ import annotations

import re
from pathlib import Path

TOP = Path(__file__).parents[2]


def document(name: str) -> str:
    """Return a document, with links as they are from the site's pages."""
    text = (TOP / name).read_text(encoding="utf-8")
    text = re.sub(r"\]\(docs/", "](", text)
    return re.sub(r"\]\(([A-Z]+\.md)\)", lambda link: f"]({link[1].lower()})", text)
