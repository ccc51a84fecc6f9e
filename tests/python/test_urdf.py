"""Chain.from_urdf from Python: paths and text, the acceleration argument, and what an error says."""

import locale
import threading

import numpy as np
import pytest

import sigmaik as sk

LIMIT = "<limit lower='-1' upper='2' velocity='3' effort='4'/>"
B_ON_A = "<joint name='j3' type='fixed'><parent link='a'/><child link='b'/></joint>"


def arm(inside=LIMIT, kind="revolute", more=""):
    """base --(j1 revolute)-- a --(j2 of the given kind)-- tip"""
    return f"""<?xml version="1.0"?>
<robot name="arm">
  <link name="base"/> <link name="a"/> <link name="tip"/>
  <joint name="j1" type="revolute"><parent link="base"/><child link="a"/>{LIMIT}</joint>
  <joint name="j2" type="{kind}"><parent link="a"/><child link="tip"/>{inside}</joint>
  {more}
</robot>
"""


def refusal(*arguments, **keywords):
    with pytest.raises(sk.Error) as caught:
        sk.Chain.from_urdf(*arguments, **keywords)
    assert isinstance(caught.value, ValueError)
    return str(caught.value)


def test_path_and_text_are_the_same(tmp_path):
    path = tmp_path / "ein Arm, äöü.urdf"
    path.write_text(arm(), encoding="utf-8")
    for source in (arm(), "\ufeff\n " + arm(), str(path), path):
        chain = sk.Chain.from_urdf(source)
        assert tuple(chain.joint_names) == ("j1", "j2")
        assert (chain.base, chain.tip, chain.dof) == ("base", "tip", 2)
        np.testing.assert_array_equal(chain.limits.lower, [-1, -1])
        np.testing.assert_array_equal(chain.limits.upper, [2, 2])
        np.testing.assert_array_equal(chain.limits.velocity, [3, 3])
        np.testing.assert_array_equal(chain.limits.effort, [4, 4])
        np.testing.assert_array_equal(chain.limits.acceleration, [np.inf, np.inf])


def test_errors_name_the_file(tmp_path):
    path = tmp_path / "arm.urdf"
    assert str(path) in refusal(path)
    assert "no such file" in refusal(path)
    path.write_text("")
    assert f"'{path}': the file is empty" in refusal(path)
    path.write_text(arm("<axis xyz='0 0 0'/>" + LIMIT))
    assert f"'{path}': joint 'j2'" in refusal(path)
    assert "directory" in refusal(tmp_path)
    assert "neither a file's path nor XML" in refusal("")
    assert "URDF text: malformed XML in line 2" in refusal("<robot name='r'>\n<link name='a'>\n</robot>")
    path.write_bytes("<robot name='r'>\n<link name='é'/></robot>".encode("latin-1"))
    assert "line 2: the name of a <link> is not UTF-8" in refusal(path)
    path.write_bytes(arm("<origin xyz='é'/>" + LIMIT).encode("latin-1"))
    assert 'xyz="?"' in refusal(path)
    with pytest.raises(TypeError):
        sk.Chain.from_urdf(7)


@pytest.mark.parametrize(
    ("source", "arguments", "facts"),
    [
        (arm(), {"base": "nowhere"}, ["base 'nowhere'", "'base', 'a', 'tip'"]),
        (arm(), {"tip": "nowhere"}, ["tip 'nowhere'", "'base', 'a', 'tip'"]),
        (arm(), {"base": "tip", "tip": "a"}, ["'a' is not below base 'tip'"]),
        (arm(more="<link name='b'/>"), {}, ["not one tree", "'base', 'b'"]),
        (arm(more="<link name='b'/>" + B_ON_A), {}, ["2 leaves below 'base'", "'tip', 'b'"]),
        (arm(""), {}, ["[j2]", "limits"]),
        (arm(kind="floating"), {}, ["'j2'", "floating"]),
        (arm(LIMIT + "<mimic joint='j2'/>"), {}, ["'j2'", "mimic"]),
        (arm("<limit lower='2' upper='1' velocity='1' effort='1'/>"), {}, ["'j2'", "lower = 2", "upper = 1"]),
        (arm("<limit lower='-1' upper='1' velocity='nan' effort='1'/>"), {}, ["'j2'", 'velocity="nan"']),
        (arm("<origin xyz='%s%n 0 0'/>" + LIMIT), {}, ["'j2'", "%s%n"]),
        (arm("<origin xyz='${x} 0 0'/>" + LIMIT), {}, ["'j2'", "${x}", "xacro"]),
        ("<robot name='r'><xacro:include filename='a'/></robot>", {}, ["xacro"]),
        ("<sdf/>", {}, ["<sdf>", "<robot>"]),
    ],
)
def test_errors_carry_the_facts(source, arguments, facts, capfd):
    text = refusal(source, **arguments)
    for fact in facts:
        assert fact in text
    out, err = capfd.readouterr()
    assert (out, err) == ("", "")


def test_acceleration():
    text = arm("<limit lower='-1' upper='1' velocity='1' effort='1' acceleration='9'/>")
    np.testing.assert_array_equal(sk.Chain.from_urdf(text).limits.acceleration, [np.inf, 9])
    for values in ([5, np.inf], (5, np.inf), np.array([5, np.inf], dtype=np.float32)):
        chain = sk.Chain.from_urdf(text, acceleration=values)
        np.testing.assert_array_equal(chain.limits.acceleration, [5, np.inf])
    message = refusal(text, acceleration=[1, 2, 3])
    assert "3 entries" in message
    assert "2 joints: 'j1', 'j2'" in message
    for bad in (0, -1, np.nan, -np.inf):
        message = refusal(text, acceleration=[1, bad])
        assert "joint 'j2'" in message
        assert "acceleration" in message
    refusal(text, acceleration=[[1, 2]])
    refusal(text, acceleration=["fast", "slow"])


def test_zero_velocity_and_effort_are_none():
    chain = sk.Chain.from_urdf(arm("<limit lower='-1' upper='1' velocity='0' effort='0'/>"))
    np.testing.assert_array_equal(chain.limits.velocity, [3, np.inf])
    np.testing.assert_array_equal(chain.limits.effort, [4, np.inf])


def test_locale_with_a_decimal_comma():
    before = locale.setlocale(locale.LC_NUMERIC)
    for name in ("de_DE.UTF-8", "fr_FR.UTF-8", "de_DE", "nl_NL.UTF-8"):
        try:
            locale.setlocale(locale.LC_NUMERIC, name)
        except locale.Error:
            continue
        try:
            chain = sk.Chain.from_urdf(arm("<origin xyz='0.125 0.25 0.5'/>" + LIMIT))
            np.testing.assert_array_equal(chain.pose([0, 0])[:3, 3], [0.125, 0.25, 0.5])
        finally:
            locale.setlocale(locale.LC_NUMERIC, before)
        return
    pytest.skip("no locale with a decimal comma is installed")


def test_threads():
    wrong = []

    def work(number):
        for _ in range(50):
            chain = sk.Chain.from_urdf(arm())
            text = refusal(arm("", more=f"<link name='x{number}'/>"))
            if chain.dof != 2 or f"'x{number}'" not in text:
                wrong.append(text)

    threads = [threading.Thread(target=work, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong
