"""Methods by name, and the base class of all methods."""

import inspect
import re
import subprocess
import sys

import numpy as np
import pytest
from all_methods import METHODS

import sigmaik as sk

J = np.random.default_rng(0).normal(size=(6, 7))
TWIST = np.ones(6)


def refused(call):
    """The text of the error, which is one line."""
    with pytest.raises(sk.ArgumentError) as error:
        call()
    text = str(error.value)
    assert "\n" not in text
    return text


def test_all_lists_every_rule_once():
    classes = [type(sk.methods.parse(name)) for name in sk.methods.ALL]
    assert len(set(classes)) == len(classes) == len(sk.methods.TITLES)
    assert {c.__name__ for c in classes} <= set(sk.__all__)
    subclasses = {c for c in vars(sk).values() if inspect.isclass(c) and issubclass(c, sk.Method)} - {sk.Method}
    assert subclasses == set(classes)
    for name, c in zip(sk.methods.ALL, classes, strict=True):
        assert c().short_name == c.short_name == name
        assert c.title == sk.methods.TITLES[name]
        assert c(**c().parameters) == c()


@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_every_method_is_a_method_and_can_be_written_as_its_name(method):
    assert isinstance(method, sk.Method)
    values = ",".join(f"{k}={v}" for k, v in method.parameters.items())
    assert sk.methods.parse(f"{method.short_name}:{values}") == method


def test_a_method_cannot_be_made_of_nothing():
    with pytest.raises(TypeError):
        sk.Method()


def test_a_name_is_accepted_wherever_a_method_is():
    expected = sk.VelocitySolver(sk.JParse(gamma=0.3)).solve(J, TWIST).qdot
    np.testing.assert_array_equal(sk.VelocitySolver("jparse:gamma=0.3").solve(J, TWIST).qdot, expected)
    np.testing.assert_allclose(sk.solve_batch("jparse:gamma=0.3", J[None], TWIST[None])[0], expected, rtol=1e-12)
    solver = sk.VelocitySolver("dls")
    assert solver.method == sk.DampedLeastSquares()
    solver.method = "jparse:gamma=0.3"
    np.testing.assert_array_equal(solver.solve(J, TWIST).qdot, expected)
    servo = sk.Servo(sk.robots.load("ufactory_xarm7"), "adaptive-dls:rule=manipulability")
    assert servo.method == sk.AdaptiveDampedLeastSquares("manipulability")
    servo.method = "safety"
    assert servo.method == sk.JacobianSafety()


def test_a_wrong_name_gives_the_names_and_the_nearest_in_one_line():
    chain = sk.robots.load("ufactory_xarm7")
    for call in (
        lambda: sk.Servo(chain, "jprase"),
        lambda: sk.VelocitySolver("jprase"),
        lambda: sk.solve_batch("jprase", J[None], TWIST[None]),
        lambda: sk.methods.parse("jprase"),
    ):
        text = refused(call)
        assert text == f"unknown method 'jprase'; there are {', '.join(sk.methods.ALL)}; did you mean 'jparse'?"
    assert "did you mean 'jparse'?" in refused(lambda: sk.Servo(chain, "JParse"))
    assert "did you mean" not in refused(lambda: sk.Servo(chain, "quaternion"))
    with pytest.raises(sk.Error, match=r"^method 'dls' has no parameter 'lambda=1'; it has damping=0.1$"):
        sk.Servo(chain, "dls:lambda=1")
    with pytest.raises(sk.Error, match=r"^method 'jparse:gamma=2': JParse: gamma = 2 must be .* at most 1$"):
        sk.Servo(chain, "jparse:gamma=2")


def test_a_wrong_parameter_gives_those_that_there_are_in_one_line():
    text = refused(lambda: sk.JParse(gama=0.1))
    assert text.startswith("JParse has no option 'gama'; did you mean 'gamma'? It has gamma, gain_linear")
    assert "JParse: gamma must be a number" in refused(lambda: sk.JParse("much"))
    assert re.search("threshold", refused(lambda: sk.AdaptiveDampedLeastSquares(threshold="much")))


def test_signatures_say_types_defaults_and_choices():
    text = sk.AdaptiveDampedLeastSquares.__init__.__doc__
    assert "rule: typing.Literal['numerical_filtering', 'manipulability', 'smallest_singular_value']" in text
    assert "threshold: typing.SupportsFloat | typing.SupportsIndex | None = None" in text
    assert "gamma: threshold in (0, 1]" in sk.JParse.__init__.__doc__


def test_defaults_of_an_application():
    defaults = {"gamma": 0.3, "max_speed": 2.0, "gain_linear": 3.0}
    assert sk.methods.parse("jparse", defaults) == sk.JParse(0.3, 3.0)
    assert sk.methods.parse("jparse:gamma=0.2", defaults) == sk.JParse(0.2, 3.0)
    assert sk.methods.parse("sdls", defaults) == sk.SelectivelyDampedLeastSquares(2.0)
    assert sk.methods.parse("dls", defaults) == sk.DampedLeastSquares()


def test_a_solver_takes_a_name_without_anything_else_imported():
    code = "from sigmaik._core import VelocitySolver; print(VelocitySolver('dls').method)"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "DampedLeastSquares(damping=0.1)"
