"""Docstrings of attributes as they are: Napoleon takes what stands before a colon for a type."""

from __future__ import annotations

from typing import Any

from sphinx.application import Sphinx

_ATTRIBUTES = ("attribute", "data", "property")
_BEFORE_NAPOLEON, _AFTER_NAPOLEON = 400, 600
# Sphinx hands over the object, the options and, last, the lines, which a handler changes in place.
_kept: dict[str, list[str]] = {}


def _keep(app: Sphinx, what: str, name: str, *rest: Any) -> None:
    if what in _ATTRIBUTES:
        _kept[name] = list(rest[-1])


def _restore(app: Sphinx, what: str, name: str, *rest: Any) -> None:
    if what in _ATTRIBUTES:
        rest[-1][:] = _kept.pop(name)


def setup(app: Sphinx) -> dict[str, Any]:
    """Put the docstrings back after Napoleon has changed them."""
    app.connect("autodoc-process-docstring", _keep, priority=_BEFORE_NAPOLEON)
    app.connect("autodoc-process-docstring", _restore, priority=_AFTER_NAPOLEON)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
