"""Numbers as text."""

from __future__ import annotations


def duration(seconds: float) -> str:
    """Format a time span in its two largest units: "2 h 5 min", "3 min 20 s" or "4 s"."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes} min"
    return f"{minutes} min {rest} s" if minutes else f"{rest} s"
