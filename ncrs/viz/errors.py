"""The error of everything that is drawn."""

from __future__ import annotations

from ncrs_envs.errors import NCRSError


class VizError(NCRSError, ValueError):
    """Nothing to show: no run, a run without results, or a missing package or encoder."""
