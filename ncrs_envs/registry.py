"""Names that users may add to: tasks, samplings, optimizers and engines.

An extension is a module that registers something when it is imported. Extensions are found as entry
points of the group ``ncrs_extensions``, and by name in the environment variable
``NCRS_EXTENSIONS``, separated by commas, which may lie in the current folder; they are imported
when a name is first looked up.
"""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Iterator, Mapping
from importlib import metadata
from typing import Any, TypeVar

from ncrs_envs.errors import NCRSError

ENTRY_POINTS = "ncrs_extensions"
VARIABLE = "NCRS_EXTENSIONS"

_Entry = TypeVar("_Entry")


class ExtensionError(NCRSError, ValueError):
    """An extension that cannot be imported, or a name that is taken or malformed."""


class Registry(Mapping[str, _Entry]):
    """A mapping from names to entries, those of extensions included.

    Args:
        kind: Word for an entry in messages, such as "task".
        entries: Entries that come with the package.
    """

    def __init__(self, kind: str, entries: Mapping[str, _Entry]) -> None:
        self._kind = kind
        self._entries = dict(entries)

    def register(self, name: str, entry: _Entry) -> None:
        """Add an entry.

        Raises:
            ExtensionError: If the name is no identifier, or belongs to another entry.
        """
        if not (isinstance(name, str) and name.isidentifier()):
            raise ExtensionError(
                f"The name of a {self._kind} must be letters, digits and underscores, such as "
                f"'my_{self._kind}', got {name!r}."
            )
        if self._entries.get(name, entry) != entry:
            raise ExtensionError(
                f"There is already a {self._kind} {name!r}; choose another name than "
                f"{', '.join(self._entries)}."
            )
        self._entries[name] = entry

    def check(self, name: Any, setting: str, error: type[NCRSError]) -> str:
        """Return ``name`` if it is known.

        Args:
            name: Name to check.
            setting: Name of the setting that has it, for the message.
            error: Class of the error to raise.

        Raises:
            NCRSError: If it is unknown, as ``error``.
        """
        if name not in self:
            raise error(f"{setting} must be one of {list(self)}, got {name!r}.")
        return str(name)

    def __getitem__(self, name: str) -> _Entry:
        if name not in self._entries:
            load_extensions()
        return self._entries[name]

    def __iter__(self) -> Iterator[str]:
        load_extensions()
        return iter(list(self._entries))

    def __len__(self) -> int:
        load_extensions()
        return len(self._entries)


_requested: set[str] = set()
"""Extensions that were imported, or are being imported."""


def load_extensions() -> None:
    """Import the extensions that are installed or named in the environment, each once.

    Raises:
        ExtensionError: If one cannot be imported.
    """
    _load_entry_points()
    for name in filter(None, map(str.strip, os.environ.get(VARIABLE, "").split(","))):
        if name not in _requested:
            _requested.add(name)
            if (here := os.getcwd()) not in sys.path:  # as for `python -m`, but not for scripts
                sys.path.append(here)
            try:
                importlib.import_module(name)
            except ImportError as error:
                raise ExtensionError(
                    f"{VARIABLE} names the module {name!r}, which cannot be imported: {error}. Put "
                    "it into the current folder or one in PYTHONPATH, or install it."
                ) from error


def _load_entry_points() -> None:
    if ENTRY_POINTS in _requested:
        return
    _requested.add(ENTRY_POINTS)
    for entry in metadata.entry_points(group=ENTRY_POINTS):
        try:
            entry.load()
        except Exception as error:  # it is somebody else's code
            raise ExtensionError(
                f"The extension {entry.name} ({entry.value}) cannot be imported: {error}."
            ) from error
