"""Threads that take turns."""

import threading
import time

import pytest

from botohe_moo.bounds.turns import Turns


@pytest.mark.parametrize("n_threads", [1, 4])
def test_one_thread_works_at_a_time_and_kernels_side_by_side(n_threads):
    turns, left = Turns(n_threads), list(range(40))
    working = aside = most_aside = 0
    lock = threading.Lock()
    everyone = threading.Barrier(n_threads, timeout=30)

    def work():
        nonlocal working, aside, most_aside
        working += 1
        assert working == 1
        if not left:
            working -= 1
            return False
        left.pop()
        is_first = len(left) >= 40 - n_threads
        working -= 1
        with turns.aside():
            with lock:
                aside += 1
                most_aside = max(most_aside, aside)
            if is_first:
                everyone.wait()  # for which all have to be here
            with lock:
                aside -= 1
        return True

    turns.repeat(work)
    assert left == []
    assert most_aside == n_threads
    with turns.aside():  # outside of work there is one thread
        pass


@pytest.mark.parametrize("error", [ValueError("wrong"), KeyboardInterrupt()])
def test_an_error_of_one_thread_ends_the_others(error):
    turns, n_calls, running = Turns(3), 0, threading.active_count()

    def work():
        nonlocal n_calls
        n_calls += 1
        number = n_calls
        with turns.aside():
            time.sleep(0.01)
        if number == 5:
            raise error
        return True

    with pytest.raises(type(error)):
        turns.repeat(work)
    assert n_calls <= 8
    assert threading.active_count() == running
