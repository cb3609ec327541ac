"""Answers that were computed once, up to so many bytes."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from threading import Lock

__all__ = ["ByteCache"]


class ByteCache:
    """Bytes by key, the least recently used given up first.

    Args:
        most: bytes held at most; a single answer above it is not kept.
    """

    def __init__(self, most: int) -> None:
        self._most, self._held, self._lock = most, 0, Lock()
        self._items: OrderedDict[Hashable, bytes] = OrderedDict()

    def get(self, key: Hashable, make: Callable[[], bytes]) -> bytes:
        """The bytes of a key, made where they are not held. What fails is not kept."""
        with self._lock:
            if key in self._items:
                self._items.move_to_end(key)
                return self._items[key]
        made = make()
        with self._lock:
            if key not in self._items and len(made) <= self._most:
                self._items[key] = made
                self._held += len(made)
                while self._held > self._most:
                    self._held -= len(self._items.popitem(last=False)[1])
        return made
