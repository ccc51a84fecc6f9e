"""What a user of the package meets first: names, arguments of every kind, errors, repr, equality, pickles."""

import copy
import inspect
import pickle
import re

import all_methods
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import sigmaik as sk

METHODS = [
    *all_methods.METHODS,
    sk.PseudoInverse(tolerance=1e-3),
    sk.DampedLeastSquares(damping=1 / 3),
    sk.AdaptiveDampedLeastSquares("manipulability", damping=0.2, threshold=0.01, relative=False),
    sk.SelectivelyDampedLeastSquares(max_speed=2),
    sk.JParse(gamma=1e-9, gain_linear=0),
    sk.JacobianProjection(gamma=0.3),
    sk.JacobianSafety(0.3),
    sk.JacobianSafetyProjection(0.3),
]


# Names ----------


def test_every_public_name_is_there_and_explained():
    assert len(set(sk.__all__)) == len(sk.__all__)
    for name in sk.__all__:
        thing = getattr(sk, name)
        if name == "__version__":
            assert re.fullmatch(r"\d+\.\d+\.\d+", thing)
            continue
        assert inspect.getdoc(thing), name
        if inspect.isclass(thing) and not issubclass(thing, (Exception, int)):
            for member, value in vars(thing).items():
                if not member.startswith("_"):
                    # An attribute whose name, type and class say everything needs no more.
                    assert inspect.getdoc(value) is not None, f"{name}.{member}"


def test_names_fixed_by_the_design():
    methods = {type(method).__name__ for method in METHODS}
    assert {"Chain", "VelocitySolver", "solve_batch", "Servo", "robots", *methods} <= set(sk.__all__)
    assert len(methods) == len(sk.methods.ALL) == 8
    chain = sk.robots.load("ufactory_xarm7")
    q = np.zeros(7)
    assert chain.dof == 7
    assert len(chain.joint_names) == 7
    assert isinstance(chain.base, str)
    assert isinstance(chain.tip, str)
    for limit in ("lower", "upper", "velocity", "acceleration", "jerk", "effort"):
        assert getattr(chain.limits, limit).shape == (7,)
    assert np.isinf(chain.limits.jerk).all()
    jerk = np.arange(1.0, 8.0)
    np.testing.assert_array_equal(chain.with_limits(jerk=jerk).limits.jerk, jerk)
    assert chain.pose(q).shape == (4, 4)
    assert chain.jacobian(q).shape == (6, 7)
    assert chain.jacobian_gradient(q).shape == (7, 6, 7)
    s = sk.VelocitySolver(
        sk.JParse(gamma=0.1, gain_linear=1.0, gain_angular=1.0, continuous=True), length_scale=1.0
    ).solve(chain.jacobian(q), np.zeros(6), posture=None)
    assert s.qdot.shape == (7,)
    assert s.status == sk.Status.OK
    assert s.singular_values.shape == s.achieved_twist.shape == (6,)
    servo = sk.Servo(chain, sk.JParse(), dt=1e-3)
    servo.reset(q, qdot=None)
    for step in (servo.update(chain.pose(q)), servo.update_twist(np.zeros(6))):
        assert step.q.shape == step.qdot.shape == (7,)
        assert step.pose_error.shape == step.achieved_twist.shape == (6,)
        assert step.scale == 1.0
        assert step.limiting_joints == ()


# Methods ----------


@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_repr_pickle_copy_equality(method):
    namespace = {name: getattr(sk, name) for name in sk.__all__}
    for same in (
        eval(repr(method), namespace),
        *(pickle.loads(pickle.dumps(method, protocol)) for protocol in range(pickle.HIGHEST_PROTOCOL + 1)),
        copy.copy(method),
        copy.deepcopy(method),
    ):
        assert type(same) is type(method)
        assert same == method
        assert hash(same) == hash(method)
        assert repr(same) == repr(method)
    assert sum(method == other for other in METHODS) == 1
    assert len({*METHODS, method}) == len(METHODS)
    assert method != repr(method)
    assert method != None  # noqa: E711
    assert method not in (0, "", object)


def test_equality_is_of_values():
    assert sk.JParse(gamma=1) == sk.JParse(gamma=1.0)
    assert sk.JParse(0.1) != sk.JParse(np.nextafter(0.1, 1))
    assert sk.JParse() != sk.JacobianSafety()
    assert sk.JacobianProjection(0.1) != sk.JacobianSafety(0.1)
    zero, minus = sk.JParse(gain_linear=0.0), sk.JParse(gain_linear=-0.0)
    assert zero != minus or hash(zero) == hash(minus)


def test_attributes_are_the_arguments_and_cannot_be_changed():
    method = sk.JParse(0.2, 2, 0.5, False)
    assert (method.gamma, method.gain_linear, method.gain_angular, method.continuous) == (
        0.2,
        2.0,
        0.5,
        False,
    )
    adaptive = sk.AdaptiveDampedLeastSquares("manipulability", 0.3, 0.01, False)
    assert (adaptive.rule, adaptive.damping, adaptive.threshold, adaptive.relative) == (
        "manipulability",
        0.3,
        0.01,
        False,
    )
    assert sk.AdaptiveDampedLeastSquares().threshold is None
    assert sk.PseudoInverse(0.1).tolerance == 0.1
    assert sk.DampedLeastSquares(0.3).damping == 0.3
    assert sk.SelectivelyDampedLeastSquares(2).max_speed == 2.0
    for m in METHODS:
        for attribute in [a for a in dir(m) if not a.startswith("_")]:
            with pytest.raises(AttributeError):
                setattr(m, attribute, getattr(m, attribute))


@pytest.mark.parametrize("bad", [0.0, -0.1, np.nan, np.inf, -np.inf])
def test_parameters_out_of_their_range(bad):
    for method, parameter in [
        (sk.PseudoInverse, "tolerance"),
        (sk.DampedLeastSquares, "damping"),
        (sk.AdaptiveDampedLeastSquares, "damping"),
        (sk.AdaptiveDampedLeastSquares, "threshold"),
        (sk.SelectivelyDampedLeastSquares, "max_speed"),
        (sk.JParse, "gamma"),
        (sk.JacobianProjection, "gamma"),
        (sk.JacobianSafety, "gamma"),
        (sk.JacobianSafetyProjection, "gamma"),
    ]:
        with pytest.raises(sk.Error, match=f"{method.__name__}.*{parameter}"):
            method(**{parameter: bad})
    if bad != 0.0:
        for parameter in ("gain_linear", "gain_angular"):
            with pytest.raises(sk.Error, match=parameter):
                sk.JParse(**{parameter: bad})


def test_parameters_that_make_no_sense():
    with pytest.raises(sk.Error, match="rule = 'nonsense'.*numerical_filtering.*manipulability"):
        sk.AdaptiveDampedLeastSquares("nonsense")
    for gamma in (1.1, 2, 1e300):
        with pytest.raises(sk.Error, match="at most 1"):
            sk.JParse(gamma)
    for wrong in ("0.1", None, [0.1], 1j):
        with pytest.raises(TypeError):
            sk.JParse(wrong)
    with pytest.raises(TypeError):
        sk.JParse(nonsense=1)


# Status and errors ----------


def test_statuses_are_ordered_from_best_to_worst():
    S = sk.Status
    assert S.OK < S.DAMPED < S.LIMITED < S.HOLDING < S.BAD_INPUT
    assert list(S) == sorted(S)
    assert [int(s) for s in S] == [0, 1, 2, 3, 4]
    assert max(S.OK, S.LIMITED, S.DAMPED) is S.LIMITED
    assert not S.OK
    assert S["DAMPED"] is S(1)
    assert S.DAMPED.name == "DAMPED"
    for status in S:
        assert pickle.loads(pickle.dumps(status)) is status


def test_errors_are_value_errors_with_the_facts():
    assert issubclass(sk.Error, ValueError)
    chain = sk.robots.load("ur10")
    for call, facts in [
        (lambda: chain.pose(np.zeros(7)), ["q", "(7,)", "(6,)"]),
        (lambda: chain.pose([0, 0, np.nan, 0, 0, 0]), ["q[2]", "nan"]),
        (lambda: chain.pose("nonsense"), ["q"]),
        (lambda: sk.JParse(2.0), ["JParse", "gamma", "2"]),
        (
            lambda: sk.VelocitySolver(sk.JParse()).solve(np.zeros((6, 7)), np.zeros(5)),
            ["twist", "(5,)", "(6,)"],
        ),
        (lambda: sk.Chain.from_urdf("<robot"), []),
    ]:
        with pytest.raises(sk.Error) as error:
            call()
        for fact in facts:
            assert fact in str(error.value)


# Chains ----------


def test_any_layout_and_type_of_q():
    chain = sk.robots.load("ur10")
    q = np.arange(6)
    for what in (chain.pose, chain.jacobian, chain.jacobian_gradient):
        expected = what(q.astype(float))
        for same in (
            q,
            q.tolist(),
            tuple(q.tolist()),
            q.astype(np.float32),
            q.astype(">f8"),
            np.repeat(q, 2)[::2],
            range(6),
        ):
            np.testing.assert_array_equal(what(same), expected)
        batch = np.random.default_rng(0).normal(size=(5, 6))
        np.testing.assert_array_equal(what(batch), [what(row) for row in batch])
        np.testing.assert_array_equal(what(np.asfortranarray(batch)), what(batch))
        np.testing.assert_array_equal(what(batch.tolist()), what(batch))
        assert what(np.zeros((0, 6))).shape == (0, *expected.shape)


@pytest.mark.parametrize("shape", [(), (0,), (5,), (7,), (20,), (1, 1, 6), (6, 1), (2, 5), (2, 20), (3, 0)])
def test_wrong_sizes_never_crash(shape):
    chain = sk.robots.load("ur10")
    for what in (chain.pose, chain.jacobian, chain.jacobian_gradient):
        with pytest.raises(sk.Error, match="shape"):
            what(np.zeros(shape))


@pytest.mark.parametrize("wrong", [None, "q", object(), {}, [None] * 6, ["a"] * 6, [[1], [2, 3]], np.zeros(6, complex)])
def test_what_is_not_numbers_is_refused(wrong):
    chain = sk.robots.load("ur10")
    for what in (chain.pose, chain.jacobian, chain.jacobian_gradient):
        with pytest.raises(sk.Error, match="q"):
            what(wrong)


def test_nan_in_a_batch_is_named():
    q = np.zeros((4, 6))
    q[2, 5] = np.nan
    with pytest.raises(sk.Error, match=r"q\[2, 5\]"):
        sk.robots.load("ur10").pose(q)


def test_random_configurations():
    chain = sk.robots.load("kinova_gen3_7dof")
    q = chain.random_configuration(1)
    np.testing.assert_array_equal(q, chain.random_configuration(1))
    generator = np.random.default_rng(1)
    np.testing.assert_array_equal(q, chain.random_configuration(generator))
    assert np.any(q != chain.random_configuration(generator))
    for seed in range(200):
        q = chain.random_configuration(seed)
        assert np.all(q >= np.maximum(chain.limits.lower, -np.pi))
        assert np.all(q <= np.minimum(chain.limits.upper, np.pi))


def test_chains_share_nothing_that_can_change():
    chain = sk.robots.load("ur10")
    lower = chain.limits.lower
    lower[:] = 0
    assert np.all(chain.limits.lower != 0)
    slower = chain.with_limits(velocity=0.1)
    assert np.all(slower.limits.velocity == 0.1)
    assert np.all(chain.limits.velocity != 0.1)
    assert "6 joints" in repr(chain)
    for wrong in (0.0, -1.0, np.nan, np.zeros(5), [[1.0] * 6], "fast", np.zeros(20)):
        with pytest.raises(sk.Error, match="velocity"):
            chain.with_limits(velocity=wrong)


# Poses ----------


def test_rotations_are_scipys():
    rng = np.random.default_rng(2)
    for _ in range(3000):
        vector = rng.normal(size=3)
        vector *= rng.choice([rng.uniform(0, 3.14), 10 ** rng.uniform(-12, 0)]) / np.linalg.norm(vector)
        R = Rotation.from_rotvec(vector).as_matrix()
        np.testing.assert_allclose(sk.rotation_exp(vector), R, rtol=0, atol=4e-15)
        np.testing.assert_allclose(sk.rotation_log(R), vector, rtol=0, atol=1e-14)
        np.testing.assert_allclose(sk.rotation_log(R), Rotation.from_matrix(R).as_rotvec(), rtol=0, atol=1e-14)


def test_half_turns():
    rng = np.random.default_rng(3)
    axes = [*np.eye(3), *-np.eye(3), *rng.normal(size=(200, 3)), *(rng.normal(size=(50, 3)) * [1, 0, 1])]
    for axis in axes:
        axis = axis / np.linalg.norm(axis)
        log = sk.rotation_log(2 * np.outer(axis, axis) - np.eye(3))
        np.testing.assert_allclose(np.linalg.norm(log), np.pi, rtol=1e-15)
        np.testing.assert_allclose(np.abs(log @ axis), np.pi, rtol=1e-14)
        assert log[np.flatnonzero(np.abs(log) > 1e-7)[0]] > 0


def test_pose_error():
    rng = np.random.default_rng(4)
    for _ in range(500):
        a, b = np.eye(4), np.eye(4)
        a[:3, :3], b[:3, :3] = Rotation.random(2, random_state=rng).as_matrix()
        a[:3, 3], b[:3, 3] = rng.normal(size=(2, 3))
        expected = (Rotation.from_matrix(b[:3, :3]) * Rotation.from_matrix(a[:3, :3]).inv()).as_rotvec()
        np.testing.assert_allclose(sk.pose_error(a, b), [*(b[:3, 3] - a[:3, 3]), *expected], rtol=0, atol=1e-12)
    for wrong in (np.eye(3), np.zeros((4, 4)), None, 2 * np.eye(4)):
        with pytest.raises(sk.Error, match="current"):
            sk.pose_error(wrong, np.eye(4))
        with pytest.raises(sk.Error, match="target"):
            sk.pose_error(np.eye(4), wrong)
    for wrong in (np.eye(4), 2 * np.eye(3), np.diag([1, 1, -1]), None):
        with pytest.raises(sk.Error, match="rotation"):
            sk.rotation_log(wrong)
    for wrong in (np.zeros(4), [0, 0, np.nan], None):
        with pytest.raises(sk.Error, match="vector"):
            sk.rotation_exp(wrong)


def test_constrained_ik_is_stepped_by_either_name():
    arm, home = sk.robots.load("ur10"), sk.robots.home("ur10")
    ours, other = sk.ConstrainedIk(arm), sk.ConstrainedIk(arm)
    for ik in (ours, other):
        ik.reset(home)
    target = ours.pose.copy()
    target[:3, 3] += [0.05, -0.02, 0.03]
    for _ in range(50):
        np.testing.assert_array_equal(ours.update(target).q, other.step(target).q)
    assert np.abs(ours.q - home).max() > 1e-3
