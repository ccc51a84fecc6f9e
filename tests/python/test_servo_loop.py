"""A ServoLoop from Python: states, stops, faults, owners, a child process. C++ tests have each call in each state."""

import os
import threading
import time

import numpy as np
import pytest

import sigmaik as sk
from sigmaik.teleop import Session

SLOW = [0.02, 0.0, 0.0, 0.0, 0.0, 0.0]
FAST = [0.3, 0.2, 0.0, 0.0, 0.3, 0.0]


def until(condition, seconds=20.0):
    """Waits for the condition; machines may be busy."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "it did not happen in time"
        time.sleep(0.001)


def started(name="franka_panda", acceleration=None, qdot=None, **options):
    arm = sk.robots.load(name)
    if acceleration is not None:
        arm = arm.with_limits(acceleration=np.full(arm.dof, acceleration))
    servo = sk.Servo(arm, **options)
    servo.reset(sk.robots.home(name), qdot)
    return servo


def moves(loop):
    samples = loop.read()
    return len(samples) > 0 and samples[-1]["qdot"].any()


@pytest.mark.parametrize("name", ["franka_panda", "ur10"])
def test_after_stop_and_start_nothing_moves(name):
    loop = sk.ServoLoop(started(name))
    loop.start()
    loop.follow_twist(FAST, 10.0)
    until(lambda: moves(loop))
    assert loop.stop() is True
    q = loop.read()[-1]["q"]
    loop.start()
    until(lambda: loop.statistics.cycles > 20)
    assert loop.state is sk.LoopState.HOLDING
    assert loop.stop()
    samples = loop.read()
    assert not samples["qdot"].any()
    assert (samples["q"] == q).all()


def test_a_session_that_is_entered_again_does_not_move():
    session = Session("ufactory_xarm7", rate=500.0)
    with session:
        session.twist(FAST)
        pose = sk.robots.load("ufactory_xarm7").pose(session.home)
        pose[1, 3] += 0.2
        session.follow(pose)
        until(lambda: len(session.read()) > 0 and session.latest["qdot"].any())
    session.read()
    with session:
        session.refresh()
        until(lambda: session.statistics.cycles > 20)
    assert not session.read()["qdot"].any()


@pytest.mark.parametrize("acceleration", [5.0, 8.0])
def test_stop_says_whether_the_arm_rests_and_lets_other_threads_run(acceleration):
    qdot = np.zeros(7)
    qdot[0] = 1.0
    loop = sk.ServoLoop(started(acceleration=acceleration, qdot=qdot))
    loop.start()
    assert loop.stop(timeout=0.0) is False
    assert loop.running
    assert loop.state is sk.LoopState.STOPPING
    answers = []
    other = threading.Thread(target=lambda: answers.append(loop.stop()))
    other.start()
    counted = 0
    while other.is_alive():
        counted += 1
        time.sleep(0.0)
    assert answers == [True]
    assert counted > 10
    assert not loop.running
    assert not loop.read()[-1]["qdot"].any()


def test_the_time_that_stop_waits_comes_from_the_limits():
    slow, quick = (sk.ServoLoop(started(acceleration=a)).stop_time for a in (0.5, 10.0))
    assert slow > 2.2 / 0.5  # the fastest joint's stop
    assert quick < slow
    with sk.ServoLoop(started()) as loop:
        loop.follow_twist(SLOW, 1.0)
    assert loop.state is sk.LoopState.DISABLED


def test_periods_and_timeouts_have_bounds():
    for dt in (1e-10, 5e-6, 11.0):
        with pytest.raises(sk.Error, match="1e-05|1.0000000000000001e-05"):
            sk.ServoLoop(started(dt=dt))
    loop = sk.ServoLoop(started(dt=5.0))
    loop.start()
    begin = time.monotonic()
    assert loop.stop()
    assert time.monotonic() - begin < 1.0
    with sk.ServoLoop(started()) as loop:
        for timeout in (0.0, -1.0, 61.0, float("inf"), float("nan")):
            with pytest.raises(sk.Error, match="60 s"):
                loop.follow_twist(SLOW, timeout)
            with pytest.raises(sk.Error, match="timeout"):
                loop.stop(timeout if timeout != 0.0 else -2.0)


@pytest.mark.parametrize("command", ["follow", "follow_twist"])
def test_a_halt_is_latched_until_it_is_released(command):
    servo = started()
    target = servo.pose.copy()
    target[1, 3] += 0.2
    argument = target if command == "follow" else FAST
    with sk.ServoLoop(servo) as loop:
        getattr(loop, command)(argument, 10.0)
        until(lambda: moves(loop))
        loop.halt()
        until(lambda: loop.state is sk.LoopState.STOPPED)
        with pytest.raises(sk.Error, match=r"release\(\)"):
            getattr(loop, command)(argument, 1.0)
        loop.read()
        loop.release()
        cycles = loop.statistics.cycles
        until(lambda: loop.statistics.cycles > cycles + 20)
        samples = loop.read()
        assert not samples["qdot"].any()
        assert set(samples["state"]) <= {sk.LoopState.STOPPED, sk.LoopState.HOLDING}
        getattr(loop, command)(argument, 10.0)
        until(lambda: moves(loop))


def test_one_commander_owns_the_arm():
    with sk.ServoLoop(started()) as loop:
        page = loop.take("page")
        assert loop.owner == "page"
        with pytest.raises(sk.Error, match="'page' owns the arm"):
            loop.follow_twist(SLOW, 1.0)
        with pytest.raises(sk.Error, match="'page'"):
            loop.take("script")
        loop.follow_twist(SLOW, 1.0, page)
        script = loop.take("script", take_over=True)
        assert script != page
        with pytest.raises(sk.Error, match="'script'"):
            loop.follow(started().pose, 1.0, token=page)
        assert loop.configure(started(), token=script) == 1
        loop.halt()
        until(lambda: loop.state is sk.LoopState.STOPPED)
        loop.release(script)
        assert not loop.give_back(page)
        assert loop.give_back(script)
        assert loop.owner == ""
        loop.follow_twist(SLOW, 1.0)


@pytest.mark.parametrize("joint", [0, 5])
def test_a_following_error_is_a_fault_until_it_is_acknowledged(joint):
    servo = started()
    loop = sk.ServoLoop(servo, max_following_error=np.full(7, 0.1))
    assert loop.fault is None
    assert not loop.measure(servo.q)  # nothing runs
    with loop:
        loop.follow_twist(SLOW, 30.0)
        assert loop.measure(servo.q, np.zeros(7))
        q = np.array(servo.q)
        q[joint] += 0.5
        assert loop.measure(q)
        until(lambda: loop.state is sk.LoopState.FAULTED)
        assert loop.fault.kind is sk.LoopFaultKind.FOLLOWING_ERROR
        assert loop.fault.joint == joint
        assert servo.chain.joint_names[joint] in loop.fault.text
        assert repr(loop.fault).startswith("LoopFault(kind='following error'")
        with pytest.raises(sk.Error, match="acknowledge"):
            loop.follow_twist(SLOW, 1.0)
        with pytest.raises(sk.Error, match=servo.chain.joint_names[joint]):
            loop.release()
    with pytest.raises(sk.Error, match="acknowledge"):
        loop.start()
    loop.acknowledge()
    assert loop.state is sk.LoopState.DISABLED
    assert loop.fault is None


@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # Python's own, of fork() with threads
@pytest.mark.parametrize("moving", [False, True])
def test_in_a_child_process_no_loop_runs(moving):
    with sk.ServoLoop(started()) as loop:
        if moving:
            loop.follow_twist(SLOW, 30.0)
        until(lambda: loop.statistics.cycles > 5)
        child = os.fork()
        if child == 0:
            right = not loop.running and loop.state is sk.LoopState.DISABLED and loop.stop() is False
            for call in (lambda: loop.follow_twist(SLOW, 1.0), loop.start, lambda: loop.take("child")):
                try:
                    call()
                    right = False
                except sk.Error as error:
                    right = right and "child" in str(error)
            os._exit(0 if right else 1)
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
        assert loop.running
