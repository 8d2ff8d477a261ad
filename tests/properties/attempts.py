"""Attempts at what may be refused, and how many of them."""

from hypothesis import settings

from ncrs_envs.errors import NCRSError


def attempt(function, *arguments):
    """The result of a call and None, or None and the message with which it was refused."""
    try:
        return function(*arguments), None
    except NCRSError as error:
        return None, str(error)


def few_examples():
    """Number of examples for whole sequences of calls, which take long."""
    return settings().max_examples // 6
