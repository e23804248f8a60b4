"""Both executors keep the same promises; the local one also ends with its parent."""

import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import executor_work as work
import pytest

from ffhnet.dataset.executors import LocalExecutor, RayExecutor, UnexpectedError, WorkerLostError, run_jobs
from ffhnet.dataset.executors import local as local_module
from ffhnet.errors import MissingExtraError, ObjectError, OptionError

needs_proc = pytest.mark.skipif(not Path("/proc").is_dir(), reason="looks for processes in /proc")


@pytest.fixture(params=["local", "ray"])
def executor(request):
    if request.param == "local":
        return LocalExecutor(2)
    return RayExecutor(request.getfixturevalue("cluster").address, workers=2)


class Jobs(list):
    """Jobs that count how many of them were taken."""

    taken = 0

    def __getitem__(self, number):
        self.taken = max(self.taken, number + 1)
        return super().__getitem__(number)


def collect(executor, function, jobs):
    results, errors = {}, {}

    def on_result(job, result):
        assert job not in results
        results[job] = result

    def on_error(job, error):
        assert job not in errors
        errors[job] = error

    executor.run(function, jobs, on_result, on_error)
    return results, errors


def wait_for(condition, seconds=120):
    """Long enough for a machine that is busy with other things."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.02)


def alive(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_every_unit_ends_once_and_bad_ones_do_not_stop_the_rest(executor):
    results, errors = collect(executor, work.bad_or_square, range(8))
    assert results == {n: n * n for n in (0, 1, 4, 5, 6, 7)}
    assert isinstance(errors[2], ObjectError)
    assert str(errors[2]) == "wanted an object, got number two"
    assert isinstance(errors[3], UnexpectedError)
    summary, *trace = str(errors[3]).splitlines()
    assert summary == "ValueError: nobody foresaw this"
    assert any("executor_work.py" in line for line in trace)


def test_killed_workers_are_replaced_and_deadly_units_given_up(executor, tmp_path):
    """One unit loses two workers and recovers, one loses three; their neighbours are not blamed."""
    deaths = {1: 2, 4: 3}
    jobs = [work.Task(n, tmp_path, seconds=0.05, deaths=deaths.get(n, 0)) for n in range(7)]
    results, errors = collect(executor, work.noted_square, jobs)
    assert {job.number for job in results} == {0, 1, 2, 3, 5, 6}
    assert {job.number: type(error) for job, error in errors.items()} == {4: WorkerLostError}
    assert "3 times" in str(errors[jobs[4]])
    assert [len(job.starts()) for job in jobs] == [1, 3, 1, 1, 3, 1, 1]


def test_few_units_are_in_flight_and_an_error_in_the_callback_stops_the_job(executor):
    """The job does not run ahead of what is taken from it: of 1000 units few were sent when it stops."""
    jobs, done = Jobs(range(1000)), []

    def on_result(job, result):
        done.append(job)
        assert jobs.taken <= len(done) + 2
        if len(done) == 20:
            raise OSError("disk full")

    with pytest.raises(OSError, match="disk full"):
        executor.run(work.square, jobs, on_result, lambda job, error: pytest.fail(str(error)))
    assert len(done) == 20


def test_nothing_to_do(executor):
    assert collect(executor, work.square, []) == ({}, {})


def test_local_workers_are_renewed(monkeypatch):
    monkeypatch.setattr(local_module, "UNITS_PER_WORKER", 3)
    results, _ = collect(LocalExecutor(1), work.process_id, range(7))
    processes = list(results.values())
    assert os.getpid() not in processes
    assert [processes.count(pid) for pid in dict.fromkeys(processes)] == [3, 3, 1]


def test_run_jobs_stops_at_the_first_failure():
    done = []
    with pytest.raises(ObjectError, match="number two"):
        run_jobs(work.bad_or_square, [0, 2, *range(4, 500)], 1, lambda: done.append(1))
    assert len(done) == 1


def test_run_jobs_gives_results_in_the_order_of_the_jobs():
    steps = []
    results = run_jobs(work.square, [5, *range(40), 5], 2, lambda: steps.append(1))
    assert results == [25, *(n * n for n in range(40)), 25]
    assert len(steps) == 42


@needs_proc
def test_local_workers_end_when_their_parent_is_killed(tmp_path):
    """Also in the middle of a unit that would take a minute."""
    program = tmp_path / "driver.py"
    program.write_text(
        "import sys, pathlib\n"
        f"sys.path.insert(0, {str(Path(work.__file__).parent)!r})\n"
        "import executor_work as work\n"
        "from ffhnet.dataset.executors import LocalExecutor\n"
        "if __name__ == '__main__':\n"
        f"    jobs = [work.Task(n, pathlib.Path({str(tmp_path)!r}), seconds=60) for n in range(9)]\n"
        "    LocalExecutor(2).run(work.noted_square, jobs, print, print)\n",
        encoding="utf-8",
    )
    driver = subprocess.Popen([sys.executable, str(program)])
    wait_for(lambda: len(list(tmp_path.glob("*-*-*"))) == 2)
    workers = [int(path.name.split("-")[1]) for path in tmp_path.glob("*-*-*")]
    assert all(alive(pid) for pid in workers)
    driver.send_signal(signal.SIGKILL)
    driver.wait()
    wait_for(lambda: not any(alive(pid) for pid in workers), seconds=5)
    assert len(list(tmp_path.glob("*-*-*"))) == 2


@needs_proc
def test_units_of_a_lost_ray_node_run_elsewhere(cluster, tmp_path):
    node = cluster.add_node(num_cpus=1)
    cluster.wait_for_nodes()
    gate = tmp_path / "gate"
    jobs = [work.Task(n, tmp_path, gate=gate) for n in range(9)]

    def lose_the_node():
        # With three units at work each node has one, as each has one CPU.
        try:
            wait_for(lambda: len(list(tmp_path.glob("*-*-*"))) == 3)
            workers = [int(path.name.split("-")[1]) for path in tmp_path.glob("*-*-*")]
            cluster.remove_node(node, allow_graceful=False)
            wait_for(lambda: not all(alive(pid) for pid in workers))
        finally:
            gate.touch()

    with ThreadPoolExecutor(1) as pool:
        loss = pool.submit(lose_the_node)
        results, errors = collect(RayExecutor(cluster.address), work.noted_square, jobs)
        loss.result()
    assert results == {job: job.number**2 for job in jobs}
    assert errors == {}
    assert sorted(len(job.starts()) for job in jobs) == [1] * 8 + [2]


@pytest.mark.parametrize("address", ["127.0.0.1:9", "ray://127.0.0.1:9", "nonsense"])
def test_a_cluster_that_is_not_there_is_an_error_at_once(address):
    pytest.importorskip("ray", reason="Ray is not installed: pip install 'ffhnet[ray]'")
    with pytest.raises(OptionError, match=f"cannot use the Ray cluster '{address}'"):
        RayExecutor(address).run(work.square, [1], print, print)


def test_without_ray_the_extra_is_named(monkeypatch):
    monkeypatch.setattr("ffhnet.dataset.executors.ray.find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match=r"ffhnet\[ray\]"):
        RayExecutor()
