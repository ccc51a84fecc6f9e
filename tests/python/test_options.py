"""Keywords of options: declared once in C++, and therefore the same in signature, docstring, stub and errors."""

import ast
import inspect
from pathlib import Path

import numpy as np
import pytest

import sigmaik as sk

ARM = "ur10"

# Classes with options: the arguments before the options, a misspelt option, and the option that was meant.
TAKES_OPTIONS = {
    "Servo": (lambda arm: (arm, sk.JParse()), "posture_gian", "posture_gain"),
    "ConstrainedIk": (lambda arm: (arm,), "torque_limit", "torque_limits"),
    "ServoLoop": (lambda arm: (started(arm),), "histroy", "history"),  # codespell:ignore
    "TargetStream": (lambda arm: (), "smothing", "smoothing"),
    "ComputedTorque": (lambda arm: (arm,), "damping", "damping_ratio"),
}
every_class = pytest.mark.parametrize("name", TAKES_OPTIONS)


def started(arm):
    servo = sk.Servo(arm, sk.JParse())
    servo.reset(sk.robots.home(ARM))
    return servo


def signature(name):
    """The arguments in the stub, without self."""
    stub = Path(sk.__file__).with_name("_core.pyi").read_text(encoding="utf-8")
    (body,) = [n.body for n in ast.parse(stub).body if isinstance(n, ast.ClassDef) and n.name == name]
    (init,) = [n for n in body if isinstance(n, ast.FunctionDef) and n.name == "__init__"]
    return init


@every_class
def test_a_misspelt_option_is_answered_in_one_line(name):
    leading, wrong, right = TAKES_OPTIONS[name]
    arm = sk.robots.load(ARM)
    with pytest.raises(sk.Error) as caught:
        getattr(sk, name)(*leading(arm), **{wrong: 1.0})
    text = str(caught.value)
    assert text.startswith(f"{name} has no option '{wrong}'; did you mean '{right}'? It has ")
    assert "\n" not in text
    listed = text.partition("It has ")[2].split(", ")
    stub = signature(name)
    optional = [a.arg for a in stub.args.args[len(stub.args.args) - len(stub.args.defaults) :]]
    assert listed == optional + [a.arg for a in stub.args.kwonlyargs]


@every_class
def test_an_option_like_no_other_gets_no_suggestion(name):
    with pytest.raises(sk.ArgumentError, match=f"^{name} has no option 'ωωω'; It has "):
        getattr(sk, name)(*TAKES_OPTIONS[name][0](sk.robots.load(ARM)), ωωω=1)


@every_class
def test_every_option_is_in_the_docstring(name):
    doc = inspect.getdoc(getattr(sk, name).__init__)
    for argument in signature(name).args.kwonlyargs:
        assert f"\n{argument.arg}: " in doc
    assert max(map(len, doc.splitlines()[1:])) <= 100


def test_choices_are_literals_in_the_stub():
    annotations = {a.arg: ast.unparse(a.annotation) for a in signature("Servo").args.kwonlyargs}
    assert annotations["on_limit"] == "typing.Literal['redistribute', 'scale']"
    assert annotations["avoid"] == "typing.Literal['manipulability', 'potential'] | None"
    assert annotations["frame"] == "typing.Literal['base', 'tool']"


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda arm: sk.Servo(), "Servo needs chain"),
        (lambda arm: sk.Servo(method=sk.JParse()), "Servo needs chain"),
        (lambda arm: sk.Servo("ur10", sk.JParse()), "chain must be a Chain, not 'ur10'"),
        (lambda arm: sk.Servo(arm, 5), "method must be .*, not 5"),
        (lambda arm: sk.Servo(arm, sk.JParse(), 1e-3, 5.0), r"by position \(chain, method, dt\), got 4"),
        (lambda arm: sk.Servo(arm, sk.JParse(), 1e-3, dt=1e-3), "given dt twice"),
        (lambda arm: sk.Servo(arm, sk.JParse(), gain_linear="fast"), "gain_linear must be a number, not 'fast'"),
        (lambda arm: sk.Servo(arm, sk.JParse(), gain_linear=None), "gain_linear must be a number, not None"),
        (lambda arm: sk.Servo(arm, sk.JParse(), jerk_limits="no"), "jerk_limits must be True or False, not 'no'"),
        (lambda arm: sk.Servo(arm, sk.JParse(), on_limit=3), "on_limit must be 'redistribute' or 'scale', not 3"),
        (lambda arm: sk.ConstrainedIk(arm, iterations=1.5), "iterations must be a whole number, not 1.5"),
        (lambda arm: sk.ConstrainedIk(arm, iterations=10**30), "iterations must be a whole number, not 1000"),
        (lambda arm: sk.ComputedTorque(arm, payload=1.0), "payload must be a Inertia, not 1.0"),
    ],
)
def test_what_is_missing_or_of_a_wrong_type(call, text):
    """These are TypeErrors, too, as elsewhere in Python, and in one line."""
    with pytest.raises(sk.ArgumentError, match=text) as caught:
        call(sk.robots.load(ARM))
    assert isinstance(caught.value, sk.Error)
    assert isinstance(caught.value, TypeError)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 200


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"on_limit": "ignore"}, "on_limit = 'ignore' must be 'redistribute' or 'scale'"),
        ({"avoid": "walls"}, "avoid = 'walls' must be None, 'manipulability' or 'potential'"),
        ({"frame": "world"}, "frame = 'world' must be 'base' or 'tool'"),
    ],
)
def test_a_word_that_is_no_choice(options, text):
    with pytest.raises(sk.Error, match=text):
        sk.Servo(sk.robots.load(ARM), sk.JParse(), **options)


def test_defaults_of_the_stub_are_those_that_hold():
    """All options, each written out with its default, make the same servo."""
    arm, home = sk.robots.load(ARM), sk.robots.home(ARM)
    stub = signature("Servo").args
    written = {}
    for argument, default in zip(stub.kwonlyargs, stub.kw_defaults, strict=True):
        text = ast.unparse(default)
        written[argument.arg] = np.inf if text == "..." else ast.literal_eval(text)
    assert written["posture_max_speed"] == np.inf
    bare, full = sk.Servo(arm, sk.JParse()), sk.Servo(arm, sk.JParse(), 1e-3, **written)
    for servo in (bare, full):
        servo.reset(home)
    for twist in np.random.default_rng(1).normal(size=(200, 6)):
        np.testing.assert_array_equal(full.update_twist(twist).qdot, bare.update_twist(twist).qdot)


@pytest.mark.parametrize(
    ("make", "options"),
    [
        (lambda arm, **o: sk.Servo(arm, sk.JParse(), **o), {"dt": 2e-3, "avoid": "manipulability", "eta2": 3.0}),
        (lambda arm, **o: sk.Servo(arm, sk.JParse(), **o), {"posture": np.arange(6.0), "exact": [1, 0, 0, 1, 0, 0]}),
        (lambda arm, **o: sk.Servo(arm, sk.JParse(), **o), {"mask": [1, 1, 0, 1, 1, 0], "frame": "tool"}),
        (sk.ConstrainedIk, {"beta": [1, 2, 3, 4, 5, 6], "gamma": 0.3, "max_error": 1e-3, "jerk_limits": False}),
        (lambda arm, **o: sk.TargetStream(**o), {"mode": "interpolate", "relocate": 7}),
        (sk.ComputedTorque, {"gravity": [0, 0, -1.6], "damping_ratio": 0.7}),
    ],
)
def test_options_are_told_again(make, options):
    arm = sk.robots.load(ARM)
    told = make(arm, **options).options
    for name, value in options.items():
        np.testing.assert_array_equal(told[name], value)
    again = make(arm, **told).options
    assert again.keys() == told.keys() > options.keys()
    for name, value in told.items():
        np.testing.assert_array_equal(again[name], value)
