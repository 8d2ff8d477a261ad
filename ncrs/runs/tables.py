"""Tables as plain text, Markdown and CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence

Rows = Sequence[Sequence[str]]


def text_table(columns: Sequence[str], rows: Rows) -> list[str]:
    """Format a table as lines of aligned columns."""
    widths = [max(map(len, cells)) for cells in zip(columns, *rows, strict=True)]
    return [
        "  ".join(cell.ljust(width) for cell, width in zip(cells, widths, strict=True)).rstrip()
        for cells in (columns, *rows)
    ]


def markdown_table(columns: Sequence[str], rows: Rows) -> list[str]:
    """Format a table as lines of Markdown."""
    lines = [columns, ["---"] * len(columns), *rows]
    return ["| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in lines]


def csv_table(columns: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """Format a table as CSV; None is empty."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(rows)
    return stream.getvalue()
