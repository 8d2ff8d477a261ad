"""Base class of the errors that these packages define."""

from __future__ import annotations


class NCRSError(Exception):
    """Base class of the errors of ``ncrs_envs`` and ``ncrs``; their messages say what to do."""
