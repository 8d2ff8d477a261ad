"""Lines for the user on the terminal, outside of any log."""

from __future__ import annotations

import multiprocessing
import os
import sys

QUIET_VARIABLE = "NCRS_QUIET"
"""Environment variable that hides notices, unless it is empty or 0."""
_MAIN_PROCESS = "MainProcess"
"""Name that ``multiprocessing`` gives to a process that is nobody's worker."""


def notice(text: str) -> None:
    """Print a line to the terminal, unless it is unwanted or the process is a worker."""
    is_unwanted = os.environ.get(QUIET_VARIABLE, "") not in ("", "0")
    is_worker = multiprocessing.current_process().name != _MAIN_PROCESS
    if is_unwanted or is_worker or sys.stderr is None:
        return
    from tqdm import tqdm  # its own print leaves progress bars whole

    tqdm.write(f"ncrs: {text} ({QUIET_VARIABLE}=1 hides this line)", file=sys.stderr)
