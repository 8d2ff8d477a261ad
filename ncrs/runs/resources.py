"""Folders that come with the package: Hydra's configuration and the published champions."""

from __future__ import annotations

from pathlib import Path

from ncrs_envs.errors import NCRSError

_PACKAGE = Path(__file__).parents[1]
_CHECKOUT = _PACKAGE.parent
_IN_CHECKOUT = {"conf": Path("conf"), "champions": Path("assets/champions")}
"""Each folder's place in a checkout; ``setup.py`` copies it into the installed package."""


class InstallationError(NCRSError, LookupError):
    """An installation that lacks some of the package's files."""


def resource_folder(name: str) -> Path:
    """Return one of the package's folders, "conf" or "champions".

    It lies in the package itself, whichever way that was installed, or in the checkout around it.

    Raises:
        InstallationError: If it is in neither.
    """
    folders = (_PACKAGE / name, _CHECKOUT / _IN_CHECKOUT[name])
    for folder in folders:
        if folder.is_dir():
            return folder
    raise InstallationError(
        f"This installation of ncrs has no {name}: {folders[0]} is missing. Reinstall it."
    )
