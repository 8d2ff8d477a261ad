"""Language of the documents, beyond what the spelling and style checkers look at."""

from __future__ import annotations

import re

import pytest

from tests.documents import DOCUMENTS, ROOT, name_of

TEXTS = [*DOCUMENTS, ROOT / "CHANGELOG.md", ROOT / "paper.md"]


def _prose(text):
    """Leave out blocks, code, equations and tables."""
    text = re.sub(r"```.*?```|\$\$.*?\$\$", "", text, flags=re.DOTALL)
    text = re.sub(r"`[^`]*`|\$[^$]*\$", "", text)
    return "\n".join(line for line in text.splitlines() if not line.startswith("|"))


@pytest.mark.parametrize("document", TEXTS, ids=name_of)
def test_no_word_stands_twice(document):
    found = re.findall(r"\b([A-Za-z]+)\s\1\b", _prose(document.read_text()))
    assert [word for word in found if word not in ("that", "had")] == []


def test_a_pet_word_is_rare():
    words = re.findall(r"\w+", " ".join(text.read_text().lower() for text in TEXTS))
    assert words.count("likewise") <= 1
