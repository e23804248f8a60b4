"""How the node fares: counts, latency and the last refusal, and the diagnostics message made of them."""

from __future__ import annotations

import threading
import time
from collections import deque

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from std_msgs.msg import Header

_REMEMBERED = 300
"""Latencies of which the median is told."""


class Health:
    """Counts what happens to views. May be told and asked by several threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._started = time.monotonic()
        self._received = self._answered = self._refused = 0
        self._last_received: float | None = None
        self._refusal: str | None = None
        self._seconds: deque[float] = deque(maxlen=_REMEMBERED)

    def received(self) -> None:
        """A view came."""
        with self._lock:
            self._received += 1
            self._last_received = time.monotonic()

    def answered(self, seconds: float) -> None:
        """Grasps were published `seconds` after their view came."""
        with self._lock:
            self._answered += 1
            self._seconds.append(seconds)
            self._refusal = None

    def refused(self, why: str) -> None:
        """A view was answered with no grasps."""
        with self._lock:
            self._refused += 1
            self._refusal = why

    def message(self, name: str, stamp: Time, dropped: int, max_age: float) -> DiagnosticArray:
        """For `/diagnostics`: OK, WARN while views are refused, STALE while none come.

        Args:
            name: of the node.
            stamp: now.
            dropped: views that a newer one replaced before their turn.
            max_age: seconds without a view after which the input is stale.
        """
        with self._lock:
            last = self._last_received
            quiet = time.monotonic() - (self._started if last is None else last)
            values = {
                "views received": str(self._received),
                "views answered": str(self._answered),
                "views refused": str(self._refused),
                "views dropped for newer ones": str(dropped),
                "seconds since the last view": "never" if last is None else f"{quiet:.2f}",
                "median latency (ms)": f"{1000 * np.median(self._seconds):.1f}" if self._seconds else "-",
            }
            refusal = self._refusal
        if quiet > max_age:
            level, text = DiagnosticStatus.STALE, f"no view for {quiet:.1f} s"
        elif refusal is not None:
            level, text = DiagnosticStatus.WARN, refusal
        else:
            level, text = DiagnosticStatus.OK, "grasps"
        status = DiagnosticStatus(
            level=level,
            name=f"{name}: grasps",
            message=text,
            hardware_id="none",
            values=[KeyValue(key=key, value=value) for key, value in values.items()],
        )
        return DiagnosticArray(header=Header(stamp=stamp), status=[status])
