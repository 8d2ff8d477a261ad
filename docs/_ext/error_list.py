"""Every error that the packages define, with its explanation."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import ncrs
import ncrs_envs
from ncrs_envs.errors import NCRSError

PACKAGES = (ncrs_envs, ncrs)


def errors() -> str:
    """List the errors by their importable names, with the built-in classes they derive from."""
    return "\n".join(map(_entry, sorted(_found(), key=_name)))


def _found() -> set[type[NCRSError]]:
    return {error for package in PACKAGES for error in _defined_below(package)}


def _defined_below(package: ModuleType) -> Iterator[type[NCRSError]]:
    (folder,) = map(Path, package.__path__)
    for path in folder.rglob("*.py"):
        if "Error(" in (source := path.read_text()) and "\nclass " in source:
            parts = path.relative_to(folder.parent).with_suffix("").parts
            module = importlib.import_module(".".join(parts).removesuffix(".__init__"))
            for name, value in vars(module).items():
                if inspect.isclass(value) and issubclass(value, NCRSError) and name[0] != "_":
                    yield value


def _name(error: type[NCRSError]) -> str:
    """Return the shortest name that the error can be imported by."""
    for package in PACKAGES:
        if error.__name__ in package.__all__ and getattr(package, error.__name__) is error:
            return f"{package.__name__}.{error.__name__}"
    return f"{error.__module__}.{error.__name__}"


def _entry(error: type[NCRSError]) -> str:
    kinds = [base.__name__ for base in error.__mro__ if base.__module__ == "builtins"]
    kinds = [kind for kind in kinds if kind not in ("Exception", "BaseException", "object")]
    first = inspect.getdoc(error).partition("\n\n")[0]  # type: ignore[union-attr]
    kind = f" Also a {' and a '.join(f'`{name}`' for name in kinds)}." if kinds else ""
    return f"`{_name(error)}`\n: {' '.join(first.split())}{kind}\n"
