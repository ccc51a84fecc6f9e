"""Texts that UTF-8 cannot encode, and inertias with a negative moment, are refused with a sigmaik.Error."""

import pathlib
import re

import numpy as np
import pytest

import sigmaik as sk
from sigmaik.teleop import Session

LONE = ("\ud800", "a\udfffb", "\udc80")


def started():
    servo = sk.Servo(sk.robots.load("ur10"))
    servo.reset(sk.robots.home("ur10"))
    return servo


@pytest.mark.parametrize("text", LONE, ids=ascii)
@pytest.mark.parametrize(
    "call",
    [
        lambda text: sk.Chain.from_urdf(f"<robot name='{text}'/>"),
        lambda text: sk.Chain.from_urdf(text + ".urdf"),
        lambda text: sk.Chain.from_urdf(pathlib.Path(text)),
        lambda text: sk.Chain.from_urdf(sk.robots.path("ur10"), base=text),
        lambda text: sk.Chain.from_urdf(sk.robots.path("ur10"), tip=text),
        lambda text: sk.Servo(sk.robots.load("ur10"), on_limit=text),
        lambda text: sk.Servo(sk.robots.load("ur10"), **{text: 1.0}),
        lambda text: sk.VelocitySolver(sk.JParse(), frame=text),
        lambda text: sk.indices.gradient(sk.robots.load("ur10"), np.zeros(6), text),
        lambda text: sk.singularities.load(text),
        lambda text: sk.planning.arm_spheres(sk.robots.load("ur10"), text),
        lambda text: sk.methods.parse(text),
        lambda text: sk.robots.load("ur10").lock({text: 0.0}),
        lambda text: sk.Collisions(sk.robots.load("ur10"), ignore=[(text, "wrist_3_link")]),
        lambda text: sk.ServoLoop(started()).take(text),
        lambda text: started().update_twist(np.zeros(6), frame=text),
        lambda text: sk.robots.load(text),
        lambda text: sk.robots.open(text),
        lambda text: Session(text),
    ],
)
def test_lone_surrogates_are_refused(call, text):
    with pytest.raises(sk.Error) as refused:
        call(text)
    str(refused.value).encode("utf-8", "backslashreplace")


def test_text_beyond_ascii_is_read():
    text = re.sub("<robot name=[^>]*>", "<robot name='Ärmchen 机械臂 🦾'>", sk.robots.path("ur10").read_text(), count=1)
    assert sk.Chain.from_urdf(text).dof == 6


@pytest.mark.parametrize(
    "tensor",
    [
        'ixx="-1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"',
        'ixx="1" iyy="1" izz="-0.01" ixy="0" ixz="0" iyz="0"',
        'ixx="1" iyy="1" izz="1" ixy="2" ixz="0" iyz="0"',  # principal moments -1, 1, 3
        'ixx="1e-6" iyy="1e-6" izz="1e-6" ixy="0" ixz="1.1e-6" iyz="0"',
    ],
)
def test_an_inertia_that_is_not_positive_is_refused(tensor):
    text = sk.robots.path("franka_panda").read_text()
    text = re.sub("<inertia [^>]*/>", f"<inertia {tensor}/>", text, count=1)
    with pytest.raises(sk.Error, match="link '.*': a principal moment of its inertia is -.*no body has a negative one"):
        sk.Chain.from_urdf(text)


@pytest.mark.parametrize("mass", ["-1", "nan", "inf"])
def test_a_mass_that_no_body_has_is_refused(mass):
    text = re.sub('<mass value="[^"]*"', f'<mass value="{mass}"', sk.robots.path("franka_panda").read_text(), count=1)
    with pytest.raises(sk.Error, match="mass"):
        sk.Chain.from_urdf(text)
