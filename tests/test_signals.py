"""Signals are held while something runs, and everything is as before when it ends."""

import signal

import pytest

from botohe_moo.base.runtime import hold_signals


def test_signals_are_held_once_and_those_that_are_ignored_stay_so():
    """``nohup`` lets SIGHUP be ignored."""
    usual = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    with hold_signals(signal.SIGHUP, signal.SIGTERM) as stop:
        signal.raise_signal(signal.SIGHUP)
        signal.raise_signal(signal.SIGTERM)
        assert stop.is_set()
        assert stop.signal == signal.SIGTERM
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGTERM)
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL
    assert signal.signal(signal.SIGHUP, usual) == signal.SIG_IGN


@pytest.mark.parametrize("handled", [False, True])
def test_a_signal_with_a_handler_of_its_own_is_held_only_if_asked_for(handled):
    came = []
    usual = signal.signal(signal.SIGINT, handler := lambda number, _: came.append(number))
    try:
        with hold_signals(signal.SIGINT, handled=handled) as stop:
            signal.raise_signal(signal.SIGINT)
            assert stop.is_set() == handled
        assert signal.getsignal(signal.SIGINT) is handler
        assert came == ([] if handled else [signal.SIGINT])
    finally:
        signal.signal(signal.SIGINT, usual)
