"""Warnings of set-up: models that lack limits or contradict themselves, and starts that are probably in degrees."""

import warnings

import numpy as np
import pytest

import sigmaik as sk

TWO_JOINTS = """<robot name="r"><link name="base"/><link name="a">{inertial}</link><link name="tip"/>
<joint name="j1" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/>
  <limit lower="-1" upper="2" velocity="3" effort="4" acceleration="10"/></joint>
<joint name="j2" type="revolute"><parent link="a"/><child link="tip"/><origin xyz="1 0 0"/><axis xyz="0 0 1"/>
  <limit lower="-1" upper="2" {velocity} effort="0" acceleration="10"/></joint></robot>"""
COMPLETE = TWO_JOINTS.format(inertial="", velocity='velocity="3"')


@pytest.fixture(autouse=True)
def every_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


def test_a_complete_model_is_taken_in_silence():
    arm = sk.Chain.from_urdf(COMPLETE)
    assert arm.warnings == ()
    assert arm.missing_limits() == ()
    sk.Servo(arm, sk.JParse()).reset([0.0, 2.5])  # outside, and by less than 1 rad
    sk.ConstrainedIk(arm).reset([0.0, 0.0])


def test_a_velocity_limit_of_zero():
    with pytest.warns(sk.ModelWarning, match="joint 'j2': velocity = 0 counts as no limit"):
        arm = sk.Chain.from_urdf(TWO_JOINTS.format(inertial="", velocity='velocity="0"'))
    with pytest.warns(sk.ModelWarning, match="'j2' has no velocity limit"):
        sk.Servo(arm, sk.JParse())
    sk.Servo(arm, sk.JParse(), velocity_limits=False)  # asked for


def test_an_inertia_that_no_body_has():
    inertia = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="3" ixy="0" ixz="0" iyz="0"/></inertial>'
    with pytest.warns(sk.ModelWarning, match="link 'a': its inertia is no rigid body's: principal moments 1, 1, 3"):
        sk.Chain.from_urdf(TWO_JOINTS.format(inertial=inertia, velocity='velocity="3"'))


@pytest.mark.parametrize("make", [sk.Servo, sk.ConstrainedIk])
def test_no_acceleration_limits(make):
    arm = sk.robots.load("ur10")
    with pytest.warns(
        sk.ModelWarning, match="the joints have no acceleration limit: 10 rad/s² or m/s² are assumed"
    ) as told:
        make(arm)
    assert len(told) == 1
    make(arm.with_limits(acceleration=10.0))
    make(arm, assumed_acceleration=5.0)  # who says what to assume knows
    make(arm, assumed_acceleration=np.inf)
    make(arm, acceleration_limits=False)
    assert arm.missing_limits(acceleration=False) == ()


@pytest.mark.parametrize("make", [lambda arm: sk.Servo(arm, sk.JParse()), sk.ConstrainedIk])
def test_degrees_are_noticed(make):
    arm = sk.robots.load("franka_panda")
    with pytest.warns(sk.ModelWarning, match="are these degrees") as told:
        make(arm).reset(np.array([0.0, -45.0, 0.0, -135.0, 0.0, 90.0, 45.0]))
    assert len(told) == 4
    assert "joint2' starts at -45 rad" in str(told[0].message)


def test_the_same_line_warns_once():
    arm = sk.robots.load("ur10")
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("default")
        for _ in range(3):
            sk.Servo(arm, sk.JParse())
    assert len(told) == 1
