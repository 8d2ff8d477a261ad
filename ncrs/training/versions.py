"""Versions of the libraries that determine a run's numbers, and a warning if they change."""

from __future__ import annotations

import platform
import warnings
from collections.abc import Mapping
from importlib.metadata import version

_PACKAGES = ("torch", "numpy", "numba", "gymnasium", "cma")


class VersionWarning(UserWarning):
    """A run is resumed with other versions of its libraries than it was saved with."""


def versions() -> dict[str, str]:
    """Look up the version of Python and of each library, by name."""
    from ncrs_envs.box2d_world import VERSION  # not above: it would delay every command

    return {
        "python": platform.python_version(),
        **{name: version(name) for name in _PACKAGES},
        # Its distribution is called box2d or box2d-py, whichever Gymnasium asks for.
        "Box2D": VERSION,
    }


def warn_of_other_versions(recorded: Mapping[str, str]) -> None:
    """Warn if a run was saved with other versions than the installed ones."""
    other = [
        f"{name} {recorded[name]} (now {own})"
        for name, own in versions().items()
        if recorded[name] != own
    ]
    if other:
        warnings.warn(
            f"This run was last saved with {', '.join(other)}: it continues, but not necessarily "
            "as it would have there.",
            VersionWarning,
            stacklevel=2,
        )
