"""What waits for the thread that works."""

import itertools

import pytest

pytest.importorskip("rospy")

from atom_calibration.runtime.inbox import Inbox


def test_the_oldest_data_give_way_and_requests_come_first():
    inbox, done = Inbox(most_data=2), []
    for number in range(4):
        inbox.put(lambda n=number: done.append(n))
    answer = inbox.ask(lambda future: future.set_result("now"))
    for _ in range(3):
        inbox.get(0.0)()
    assert (done, inbox.dropped, answer.result(0)) == ([2, 3], 2, "now")
    assert inbox.get(0.0) is None


def test_once_closed_it_gets_empty_though_each_task_brings_another_one():
    inbox = Inbox(most_data=5)

    def work():
        inbox.put(work)

    inbox.put(work)
    inbox.close()
    tasks = itertools.takewhile(lambda task: task is not None, (inbox.get(0.0) for _ in range(9)))
    assert len([task() for task in tasks]) == 1
