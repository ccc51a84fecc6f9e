"""solve_batch: the answers of fresh solvers, whatever order and threads, and without the GIL."""

import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from all_methods import METHODS

import sigmaik as sk


def problem(seed, count, m, n):
    rng = np.random.default_rng(seed)
    J = rng.normal(size=(count, m, n))
    if count >= 8:
        J[0] = 0.0
        J[1, 0] = J[1, -1]
        J[2] *= 1e-8
        J[3] *= 1e200
        J[4, :, 0] *= 1e6
        J[5] = np.eye(m, n)
        J[6] = np.ones((m, n))
    return J, rng.normal(size=(count, m))


@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_the_answers_of_fresh_solvers(method):
    for m in range(1, 7):
        for n in (1, 2, 3, 6, 7, 8, 9, 16):
            J, twist = problem(10 * m + n, 12, m, n)
            solvers = [sk.VelocitySolver(method, 0.6).solve(j, x).qdot for j, x in zip(J, twist, strict=True)]
            expected = sk.solve_batch(method, J, twist, length_scale=0.6)
            size = np.abs(solvers).max(axis=1, keepdims=True)
            assert (np.abs(expected - solvers) <= 1e-9 * size).all()
            for threads in (1, 2, 5, 12, 13, 1000):
                qdot = sk.solve_batch(method, J, twist, length_scale=0.6, threads=threads)
                assert qdot.shape == (12, n)
                assert qdot.dtype == np.float64
                assert qdot.flags.c_contiguous
                np.testing.assert_array_equal(qdot, expected)


def test_shuffled_problems_give_shuffled_answers():
    J, twist = problem(1, 1000, 6, 7)
    order = np.random.default_rng(2).permutation(1000)
    qdot = sk.solve_batch(sk.JParse(), J, twist)
    np.testing.assert_array_equal(sk.solve_batch(sk.JParse(), J[order], twist[order]), qdot[order])
    np.testing.assert_array_equal(sk.solve_batch(sk.JParse(), J[::-1], twist[::-1], threads=3), qdot[::-1])


def test_any_layout_and_type():
    rng = np.random.default_rng(3)
    J, twist = rng.normal(size=(50, 6, 7)).astype(np.float32), rng.normal(size=(50, 6)).astype(np.float32)
    expected = sk.solve_batch(sk.JParse(), J.astype(float), twist.astype(float))
    for same in (
        sk.solve_batch(sk.JParse(), J, twist),
        sk.solve_batch(sk.JParse(), J.tolist(), twist.tolist()),
        sk.solve_batch(sk.JParse(), np.asfortranarray(J), np.asfortranarray(twist)),
        sk.solve_batch(sk.JParse(), np.repeat(J, 2, axis=0)[::2], np.repeat(twist, 2, axis=1)[:, ::2]),
        sk.solve_batch(sk.JParse(), J.transpose(0, 2, 1).copy().transpose(0, 2, 1), twist),
        sk.solve_batch(sk.JParse(), J.astype(">f8"), twist.astype("<f8")),
    ):
        np.testing.assert_array_equal(same, expected)


def test_arguments_are_left_alone():
    J, twist = problem(4, 20, 6, 7)
    before = J.copy(), twist.copy()
    J.flags.writeable = twist.flags.writeable = False
    sk.solve_batch(sk.JParse(), J, twist, length_scale=0.1)
    np.testing.assert_array_equal(J, before[0])
    np.testing.assert_array_equal(twist, before[1])


def test_an_empty_batch():
    assert sk.solve_batch(sk.JParse(), np.zeros((0, 6, 7)), np.zeros((0, 6)), threads=4).shape == (0, 7)


@pytest.mark.parametrize(
    ("J", "twist"),
    [
        ((6, 7), (6,)),
        ((2, 6, 7), (6,)),
        ((2, 6, 7), (2, 7)),
        ((2, 6, 7), (3, 6)),
        ((2, 6, 7), (2, 6, 1)),
        ((2, 0, 7), (2, 0)),
        ((2, 7, 7), (2, 7)),
        ((2, 6, 0), (2, 6)),
        ((2, 6, 17), (2, 6)),
        ((2, 2, 6, 7), (2, 2, 6)),
        ((0,), (0,)),
        ((2, 20, 20), (2, 20)),
    ],
)
def test_shapes_that_do_not_fit_are_refused(J, twist):
    with pytest.raises(ValueError, match="shape|rows|columns") as error:
        sk.solve_batch(sk.JParse(), np.zeros(J), np.zeros(twist))
    assert isinstance(error.value, sk.Error)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_is_refused_with_its_place(bad):
    J, twist = problem(5, 10, 6, 7)
    J[4, 2, 5] = bad
    with pytest.raises(sk.Error, match=r"J\[4, 2, 5\]"):
        sk.solve_batch(sk.JParse(), J, twist)
    J[4, 2, 5] = 0.0
    twist[9, 1] = bad
    with pytest.raises(sk.Error, match=r"twist\[9, 1\]"):
        sk.solve_batch(sk.JParse(), J, twist)


def test_parameters_out_of_their_range_are_refused():
    J, twist = problem(6, 3, 6, 7)
    for threads in (0, -1):
        with pytest.raises(sk.Error, match="threads"):
            sk.solve_batch(sk.JParse(), J, twist, threads=threads)
    for length_scale in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(sk.Error, match="length_scale"):
            sk.solve_batch(sk.JParse(), J, twist, length_scale=length_scale)
    for not_a_method in ("JParse", None, sk.JParse, 0.1):
        with pytest.raises(TypeError):
            sk.solve_batch(not_a_method, J, twist)
    for not_numbers in ("abc", None, [["a"]], object(), J.astype(complex)):
        with pytest.raises(sk.Error):
            sk.solve_batch(sk.JParse(), not_numbers, twist)


@pytest.mark.parametrize("threads", [1, 2])
def test_other_threads_run_meanwhile(threads):
    J, twist = problem(7, 100_000, 6, 7)
    done = threading.Event()

    def work():
        sk.solve_batch(sk.JParse(), J, twist, threads=threads)
        done.set()

    worker = threading.Thread(target=work)
    start = time.perf_counter()
    worker.start()
    ticks = 0
    while not done.is_set():
        time.sleep(1e-4)
        ticks += 1
    took = time.perf_counter() - start
    worker.join()
    # With the GIL held there would be one or two ticks.
    assert ticks > 5, f"{ticks} ticks in {took} s"


def test_many_python_threads_at_once():
    J, twist = problem(8, 2000, 6, 7)
    expected = sk.solve_batch(sk.JParse(), J, twist)
    answers = [None] * 8

    def work(i):
        answers[i] = sk.solve_batch(sk.JParse(), J, twist, threads=1 + i % 3)

    workers = [threading.Thread(target=work, args=(i,)) for i in range(8)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    for answer in answers:
        np.testing.assert_array_equal(answer, expected)


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_without_memory_for_threads_it_works_alone():
    script = """
import resource, numpy as np, sigmaik as sk
rng = np.random.default_rng(0)
J, twist = rng.normal(size=(1000, 6, 7)), rng.normal(size=(1000, 6))
expected = sk.solve_batch(sk.JParse(), J, twist)
pages = int(open("/proc/self/statm").read().split()[0])
limit = pages * resource.getpagesize() + (4 << 20)  # less than the stack of a thread
resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
assert np.array_equal(sk.solve_batch(sk.JParse(), J, twist, threads=1000), expected)
"""
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=120)
    assert run.returncode == 0, run.stderr
