"""Jobs that stop their own process as a debugger would; nothing heavy to import."""

import os
import signal


def stop_once(path):
    """Stop this process, but for the second one, which returns a number."""
    try:
        with open(path, "x"):
            pass
    except FileExistsError:
        return 7
    return os.kill(os.getpid(), signal.SIGSTOP)


def stop_always(_):
    """Stop this process."""
    os.kill(os.getpid(), signal.SIGSTOP)
