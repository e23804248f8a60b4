"""Units of work on processes of this machine."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from multiprocessing.connection import Connection, wait
from typing import Any, NoReturn

from ffhnet.dataset.executors.base import UNITS_PER_WORKER, Job, Losses, Outcome, Result, attempt

_THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


class LocalExecutor:
    """Runs units in `workers` processes of this machine.

    Every process has a pipe of its own and one unit at a time, so that it is known which unit a process had
    that died; the pools of the standard library do not tell.
    """

    def __init__(self, workers: int) -> None:
        self._workers = workers

    def run(
        self,
        work: Callable[[Job], Result],
        jobs: Sequence[Job],
        on_result: Callable[[Job, Result], None],
        on_error: Callable[[Job, Exception], None],
    ) -> None:
        """See `Executor.run`."""
        waiting, losses = deque(range(len(jobs))), Losses()
        idle: list[_Worker] = []
        busy: dict[Any, tuple[_Worker, int]] = {}
        with _one_thread_per_process():
            try:
                while waiting or busy:
                    while waiting and len(busy) < self._workers:
                        worker, unit = idle.pop() if idle else _Worker(work), waiting.popleft()
                        busy[worker.connection] = worker, unit
                        worker.give(jobs[unit])
                    for connection in wait(list(busy)):
                        worker, unit = busy.pop(connection)
                        outcome = worker.take()
                        if outcome is None:
                            outcome = losses.add(unit, worker.cause_of_death())
                        elif worker.given < UNITS_PER_WORKER:
                            idle.append(worker)
                        else:
                            worker.kill()
                        if outcome is None:
                            waiting.append(unit)
                        else:
                            outcome.report(jobs[unit], on_result, on_error)
            finally:
                for worker in (*idle, *(worker for worker, _ in busy.values())):
                    worker.kill()


def run_jobs(
    work: Callable[[Job], Result], jobs: Sequence[Job], workers: int, on_done: Callable[[], None]
) -> list[Result]:
    """Results in the order of the jobs, in whatever order processes end; a failure stops the rest.

    Args:
        work: what is done with each job.
        jobs: units of work.
        workers: processes.
        on_done: called as each job ends.

    Raises:
        FFHNetError: raised by `work`.
        WorkerLostError: a job was given up.
        UnexpectedError: `work` raised something else.
    """
    results: dict[int, Result] = {}

    def done(numbered: tuple[int, Job], result: Result) -> None:
        results[numbered[0]] = result
        on_done()

    def fail(numbered: tuple[int, Job], error: Exception) -> NoReturn:
        raise error

    LocalExecutor(workers).run(partial(_without_number, work), list(enumerate(jobs)), done, fail)
    return [results[number] for number in range(len(jobs))]


def _without_number(work: Callable[[Job], Result], numbered: tuple[int, Job]) -> Result:
    return work(numbered[1])


class _Worker:
    """A process that takes units from its pipe for as long as this process lives."""

    def __init__(self, work: Callable) -> None:
        context = multiprocessing.get_context("spawn")
        self.connection, theirs = context.Pipe()
        self.given = 0
        self._process = context.Process(target=_serve, args=(theirs,), daemon=True)
        self._process.start()
        # With the process's own end its last one, the pipe ends when the process dies.
        theirs.close()
        self._send(work)

    def give(self, job: object) -> None:
        """Sends a unit."""
        self.given += 1
        self._send(job)

    def take(self) -> Outcome | None:
        """How the unit ended, or None where the process died."""
        try:
            return self.connection.recv()
        except (EOFError, OSError):
            return None

    def _send(self, message: object) -> None:
        # Where the process has died, `take` will say so.
        with contextlib.suppress(ConnectionError):
            self.connection.send(message)

    def cause_of_death(self) -> str:
        """What the operating system says about it."""
        self.kill()
        code = self._process.exitcode or 0
        return f"killed by {signal.Signals(-code).name}" if code < 0 else f"with exit status {code}"

    def kill(self) -> None:
        """Ends the process, whatever it is doing."""
        # Closing the pipe ends one that is idle; one that has just died keeps its own exit status.
        self.connection.close()
        self._process.join(timeout=0.2)
        self._process.kill()
        self._process.join()


def _serve(connection: Connection) -> None:
    """What a worker process does: the pipe brings the work, then units for it."""
    # Ctrl-C reaches the whole group of processes: the parent decides.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    with contextlib.suppress(EOFError, ConnectionError):
        # Only now its module is imported, which takes seconds, so that the parent is watched meanwhile.
        work = connection.recv()
        while True:
            connection.send(attempt(work, connection.recv()))


def _end_with_parent() -> None:
    """Ends this process as soon as its parent is dead: nobody would take the result."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
    os._exit(1)


@contextlib.contextmanager
def _one_thread_per_process() -> Iterator[None]:
    """Makes new processes compute on one thread: many small arrays, and the processes fill the cores.

    Fresh interpreters read these variables when they import NumPy.
    """
    before = {name: os.environ.get(name) for name in _THREAD_VARIABLES}
    os.environ.update(dict.fromkeys(_THREAD_VARIABLES, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
