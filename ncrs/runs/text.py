"""Numbers as people read them."""

from __future__ import annotations


def duration_text(seconds: float) -> str:
    """A duration in its two largest units, such as "3 h 20 min", "5 min 7 s" or "12 s"."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes} min"
    return f"{minutes} min {rest} s" if minutes else f"{rest} s"
