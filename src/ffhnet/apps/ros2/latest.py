"""A mailbox that holds one thing, the newest: what comes too fast replaces what nobody has taken yet."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass
from typing import Generic, TypeVar

T = TypeVar("T")


@dataclass(frozen=True)
class Arrival(Generic[T]):
    """Something and when it came.

    Attributes:
        item: what came.
        time: of `time.monotonic`, seconds; clocks of other computers do not matter to it.
    """

    item: T
    time: float

    @property
    def age(self) -> float:
        """Seconds since it came."""
        return time.monotonic() - self.time


class Latest(Generic[T]):
    """Between threads that bring things and threads that work on them."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._newest: Arrival[T] | None = None
        self._taken = True
        self._closed = False
        self._replaced = 0

    def put(self, item: T) -> None:
        """Bring the newest; what was not taken before is dropped."""
        with self._changed:
            self._replaced += not self._taken
            self._newest, self._taken = Arrival(item, time.monotonic()), False
            self._changed.notify_all()

    def take(self) -> Arrival[T] | None:
        """Wait for something that nobody took; None when the mailbox was closed."""
        with self._changed:
            self._changed.wait_for(lambda: self._closed or not self._taken)
            self._taken = True
            return None if self._closed else self._newest

    def peek(self) -> Arrival[T] | None:
        """The newest that ever came, taken or not; None if nothing came."""
        with self._changed:
            return self._newest

    def close(self) -> None:
        """Send everybody home who waits or will wait."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    @property
    def dropped(self) -> int:
        """How many were replaced before anybody took them."""
        with self._changed:
            return self._replaced
