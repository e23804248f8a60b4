"""Runs independent jobs on local processes."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from typing import TypeVar

Job = TypeVar("Job")
Result = TypeVar("Result")

_THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def run_jobs(
    work: Callable[[Job], Result], jobs: Sequence[Job], workers: int, on_done: Callable[[Result], None]
) -> None:
    """Calls `work(job)` for every job in `workers` processes, and `on_done(result)` here as each ends.

    `work` must be a module-level function. The first job that fails stops the rest and raises here.
    """
    if not jobs:
        return
    # One numeric thread per process: many small arrays, and the processes already fill the cores.
    # Fresh interpreters read these when they import NumPy.
    before = {name: os.environ.get(name) for name in _THREAD_VARIABLES}
    os.environ.update(dict.fromkeys(_THREAD_VARIABLES, "1"))
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(max_workers=min(workers, len(jobs)), mp_context=context)
    try:
        futures = [pool.submit(work, job) for job in jobs]
        for future in as_completed(futures):
            on_done(future.result())
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
