"""Running independent units of work: on processes of this machine, or on a Ray cluster."""

from ffhnet.dataset.executors.base import Executor, UnexpectedError, WorkerLostError
from ffhnet.dataset.executors.local import LocalExecutor, run_jobs
from ffhnet.dataset.executors.ray import RayExecutor

__all__ = ["Executor", "LocalExecutor", "RayExecutor", "UnexpectedError", "WorkerLostError", "run_jobs"]
