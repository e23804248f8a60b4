"""The mailbox between the callbacks and the worker."""

import threading
import time

from ffhnet.apps.ros2.latest import Latest


def test_only_the_newest_is_taken_and_the_others_are_counted():
    mailbox = Latest()
    for item in range(5):
        mailbox.put(item)
    assert mailbox.take().item == 4
    assert mailbox.dropped == 4
    mailbox.put(5)
    assert mailbox.take().item == 5
    assert mailbox.dropped == 4


def test_what_was_taken_can_still_be_seen_and_grows_old():
    mailbox = Latest()
    assert mailbox.peek() is None
    mailbox.put("view")
    mailbox.take()
    time.sleep(0.01)
    assert mailbox.peek().item == "view"
    assert mailbox.peek().age >= 0.01


def test_nothing_is_taken_twice():
    mailbox, taken = Latest(), []

    def work():
        while (arrival := mailbox.take()) is not None:
            taken.append(arrival.item)

    workers = [threading.Thread(target=work) for _ in range(3)]
    for worker in workers:
        worker.start()
    for item in range(2000):
        mailbox.put(item)
    deadline = time.monotonic() + 20
    while 1999 not in taken and time.monotonic() < deadline:
        time.sleep(0.001)
    mailbox.close()
    for worker in workers:
        worker.join(timeout=20)
        assert not worker.is_alive()
    assert len(set(taken)) == len(taken)
    assert len(taken) + mailbox.dropped == 2000


def test_a_closed_mailbox_sends_everybody_home():
    mailbox = Latest()
    mailbox.put(1)
    mailbox.close()
    assert mailbox.take() is None
