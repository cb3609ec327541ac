"""Signals: a gentle computation ends at its next report, any other one at once."""

from __future__ import annotations

import signal
import sys

import pytest

from granufab.cli.interruption import watch_signals
from granufab.cli.progress import show_progress

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
SIGNALS = [signal.SIGINT, signal.SIGTERM]


@pytest.mark.parametrize("number", SIGNALS)
def test_a_gentle_computation_ends_at_its_next_report(number: signal.Signals) -> None:
    went_on = False
    with watch_signals(), show_progress(gentle=True) as report:
        report("working", 0.1)
        signal.raise_signal(number)
        went_on = True
        with pytest.raises(KeyboardInterrupt):
            report("working", 0.2)
    assert went_on


@pytest.mark.parametrize("number", SIGNALS)
def test_a_second_signal_stops_at_once(number: signal.Signals) -> None:
    with watch_signals(), show_progress(gentle=True):
        signal.raise_signal(number)
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(number)


@pytest.mark.parametrize("number", SIGNALS)
def test_anything_else_stops_at_once(number: signal.Signals) -> None:
    with watch_signals(), show_progress() as report:
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(number)
        # An exception that was swallowed on its way comes again with the next report.
        with pytest.raises(KeyboardInterrupt):
            report("working", 0.5)


def test_the_earlier_handlers_come_back() -> None:
    before = [signal.getsignal(number) for number in SIGNALS]
    with watch_signals():
        assert [signal.getsignal(number) for number in SIGNALS] != before
    assert [signal.getsignal(number) for number in SIGNALS] == before


def test_an_old_request_is_forgotten() -> None:
    with watch_signals(), pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)
    with watch_signals(), show_progress() as report:
        report("working", 0.5)
