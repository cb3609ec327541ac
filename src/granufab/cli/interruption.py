"""Ctrl-C and SIGTERM: both end the program like an interruption, never inside a file write.

An exception raised wherever a signal happens to arrive can vanish in a callback of a library, so
a gentle computation is stopped at its next report of progress; a second signal stops at once.
"""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager

__all__ = ["gently", "stop_if_asked", "watch_signals"]

_SIGNALS = (signal.SIGINT, signal.SIGTERM)


class _State:
    asked = False
    gentle = False


def _receive(number: int, frame: object) -> None:
    again, _State.asked = _State.asked, True
    if again or not _State.gentle:
        raise KeyboardInterrupt
    if sys.stderr.isatty():
        print("stopping after this step; once more to stop at once", file=sys.stderr)


def stop_if_asked() -> None:
    """Raise :class:`KeyboardInterrupt` if a signal has come."""
    if _State.asked:
        raise KeyboardInterrupt


@contextmanager
def gently(wanted: bool) -> Iterator[None]:
    """While the block runs, let a first signal wait for :func:`stop_if_asked`."""
    _State.gentle = wanted
    try:
        yield
    finally:
        _State.gentle = False


@contextmanager
def watch_signals() -> Iterator[None]:
    """Handle the signals while the block runs, then put the earlier handlers back."""
    _State.asked = _State.gentle = False
    try:
        earlier = [signal.signal(number, _receive) for number in _SIGNALS]
    except ValueError:  # not in the main thread: signals stay with the caller
        yield
        return
    try:
        yield
    finally:
        for number, handler in zip(_SIGNALS, earlier, strict=True):
            signal.signal(number, handler)
