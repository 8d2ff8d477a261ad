"""The base class of every error that these packages raise on purpose."""

from __future__ import annotations


class NCRSError(Exception):
    """Base class of all errors of ``ncrs_envs`` and ``ncrs``; the message says what to do."""
