"""Units of work on a Ray cluster."""

from __future__ import annotations

import contextlib
import logging
import os
import socket
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from importlib.util import find_spec
from typing import Any

from ffhnet.dataset.executors.base import (
    UNITS_PER_WORKER,
    Job,
    Losses,
    Outcome,
    Result,
    WorkerLostError,
    attempt,
)
from ffhnet.errors import MissingExtraError, OptionError

_CONNECT_SECONDS = 5


class RayExecutor:
    """Runs units as Ray tasks of one CPU each; units of a lost node or worker run elsewhere.

    Args:
        address: of the cluster as `ray.init` takes it ("auto", "HOST:PORT", "ray://HOST:PORT"). None is the
            cluster that this machine belongs to or, where there is none, a new one on this machine.
        workers: most units in flight; None for as many as keep all CPUs of the cluster busy.

    Raises:
        MissingExtraError: Ray is not installed.
    """

    def __init__(self, address: str | None = None, workers: int | None = None) -> None:
        if find_spec("ray") is None:
            raise MissingExtraError("the Ray executor needs ray: pip install 'ffhnet[ray]'")
        self._address, self._workers = address, workers

    def run(
        self,
        work: Callable[[Job], Result],
        jobs: Sequence[Job],
        on_result: Callable[[Job, Result], None],
        on_error: Callable[[Job, Exception], None],
    ) -> None:
        """See `Executor.run`.

        Raises:
            OptionError: there is no such cluster.
            WorkerLostError: the cluster is gone, or its workers cannot run this package.
        """
        if not jobs:
            return
        with _connected(self._address) as ray:
            # Our own count of lost workers holds for every cause; Ray would retry some of them for ever.
            task = ray.remote(num_cpus=1, max_retries=0, max_calls=UNITS_PER_WORKER)(attempt)
            waiting, losses = deque(range(len(jobs))), Losses()
            flying: dict[Any, int] = {}
            try:
                while waiting or flying:
                    limit = self._workers or _units_to_keep_busy(ray)
                    while waiting and len(flying) < limit:
                        unit = waiting.popleft()
                        flying[task.remote(work, jobs[unit])] = unit
                    (ready,), _ = ray.wait(list(flying), num_returns=1)
                    unit = flying.pop(ready)
                    outcome = _outcome(ray, ready, losses, unit)
                    if outcome is None:
                        waiting.append(unit)
                    else:
                        outcome.report(jobs[unit], on_result, on_error)
            finally:
                for reference in flying:
                    ray.cancel(reference, force=True)


def _units_to_keep_busy(ray: Any) -> int:
    """As many again as there are CPUs, so that none waits for the driver and an autoscaler sees the demand.

    Bounded, so that neither the driver nor the cluster holds a long queue. Asked again as nodes come and go.
    """
    return 2 * max(1, int(ray.cluster_resources().get("CPU", 0)))


def _outcome(ray: Any, reference: Any, losses: Losses, unit: int) -> Outcome | None:
    """How a unit ended, or None where its worker was lost and it is to be run again."""
    try:
        return ray.get(reference)
    except ray.exceptions.RayTaskError as error:
        # `attempt` raises nothing: the unit could not even be started.
        reason = str(error).strip().splitlines()[-1]
        raise WorkerLostError(
            f"a Ray worker cannot run a unit ({reason}): every node needs the same version of ffhnet"
        ) from error
    except ray.exceptions.RayError as error:
        return losses.add(unit, f"by {type(error).__name__}")


@contextlib.contextmanager
def _connected(address: str | None) -> Iterator[Any]:
    """The module `ray`, connected; a connection that is there already is used, and left open."""
    # Read when Ray is imported: nothing is reported to anybody.
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    import ray

    mine = not ray.is_initialized()
    if mine:
        try:
            if address is not None:
                _check_reachable(address)
            ray.init(address, include_dashboard=False, log_to_driver=False, logging_level=logging.ERROR)
        except (OSError, RuntimeError, ValueError, ImportError) as error:
            name = "of this machine" if address is None else repr(address)
            raise OptionError(f"cannot use the Ray cluster {name}: {_one_line(error)}") from error
    try:
        yield ray
    except ConnectionError as error:
        raise WorkerLostError(f"the Ray cluster is gone: {_one_line(error)}") from error
    finally:
        if mine:
            ray.shutdown()


def _check_reachable(address: str) -> None:
    """Raises OSError where nothing listens: Ray itself tries for many minutes."""
    host, colon, port = address.removeprefix("ray://").rpartition(":")
    if colon and port.isdigit():
        socket.create_connection((host.strip("[]"), int(port)), _CONNECT_SECONDS).close()


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())
