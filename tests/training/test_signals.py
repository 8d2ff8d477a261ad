"""Which signals request a stop, and who gets them otherwise."""

import os
import signal

import pytest

from ncrs.training.signals import StopRequest


@pytest.fixture
def handled():
    """Sets handlers for one test."""
    before = {}

    def handle(number, handler):
        before.setdefault(number, signal.getsignal(number))
        signal.signal(number, handler)

    yield handle
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_the_first_signal_requests_a_stop(handled, number):
    handled(number, signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL)
    with StopRequest() as stop:
        assert not stop()
        os.kill(os.getpid(), number)
        assert stop()
        assert stop.received is number


def test_what_nohup_ignores_stays_ignored(handled):
    handled(signal.SIGHUP, signal.SIG_IGN)
    with StopRequest() as stop:
        os.kill(os.getpid(), signal.SIGHUP)
        assert not stop()


def test_a_schedulers_signal_requests_a_stop_and_is_its_own_again(handled):
    seen = []
    handled(signal.SIGTERM, lambda number, frame: seen.append(number))
    handled(signal.SIGUSR2, lambda number, frame: seen.append(number))
    with StopRequest() as stop:
        os.kill(os.getpid(), signal.SIGTERM)
        assert seen == [signal.SIGTERM]
        assert not stop()
        os.kill(os.getpid(), signal.SIGUSR2)
        assert stop.received is signal.SIGUSR2
    signal.raise_signal(signal.SIGUSR2)
    assert seen == [signal.SIGTERM, signal.SIGUSR2]


def test_somebody_may_ask_without_a_signal():
    with StopRequest() as stop:
        stop.ask()
    assert stop()
    assert stop.received is None
