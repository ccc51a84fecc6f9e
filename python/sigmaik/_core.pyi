"""
The compiled part of sigmaik. Import sigmaik instead.
"""
from __future__ import annotations
import collections.abc
import enum
import numpy
import numpy.typing
import os
import pathlib
import sigmaik.planning.status
import typing
__all__: list[str] = ['ActionChunks', 'ActionStatus', 'ActionTarget', 'AdaptiveDampedLeastSquares', 'AnalyticBranch', 'AnalyticIk', 'ArgumentError', 'ArmSpheres', 'Capsule', 'CartError', 'CartMeasures', 'CartMotion', 'CartRegion', 'Chain', 'ChunkCounts', 'ChunkStatus', 'Clearance', 'Collisions', 'ComputedTorque', 'ComputedTorqueStep', 'ConstrainedIk', 'ConstrainedIkStep', 'Crossing', 'DEFAULT_SCALE', 'DampedLeastSquares', 'DistanceField', 'Dynamics', 'Error', 'GuideState', 'Inertia', 'JParse', 'JacobianProjection', 'JacobianSafety', 'JacobianSafetyProjection', 'JointCost', 'JointLimits', 'LeastSquaresSolution', 'LinkCapsule', 'LoopCommand', 'LoopFault', 'LoopFaultKind', 'LoopState', 'LoopStatistics', 'LoopToken', 'Method', 'ModelWarning', 'Obstacle', 'PlaneCartMotion', 'Playback', 'PositionIk', 'PositionIkBranch', 'PositionIkResult', 'PositionIkStatus', 'PseudoInverse', 'SampleCounts', 'SampleStatus', 'Segment', 'SelectivelyDampedLeastSquares', 'Servo', 'ServoBatch', 'ServoLoop', 'ServoStep', 'SingularSets', 'Solution', 'Spectrum', 'Status', 'StreamStatus', 'Target', 'TargetStream', 'TimeOptimal', 'TimeOptimalResult', 'Trajectory', 'VelocitySolver', 'admissible_guess', 'cart_descent', 'cart_motion', 'cart_motion_by_descent', 'clearance', 'collision_cost', 'draw_from_prior', 'evaluate_cart_motion', 'evaluate_cart_motion_plane', 'evaluate_index', 'forbidden_intervals', 'geometry_aware_cost', 'index_of_jacobian', 'joint_limit_cost', 'known_singular_sets', 'least_squares', 'load_singular_sets', 'log_manipulability_cost', 'manipulability_cost', 'min_distance', 'nearest_turn', 'plan_gradient', 'plan_stochastic', 'plane_cart_motion', 'planner_options', 'play', 'pose_error', 'potential_cost', 'reference_scale', 'rotation_exp', 'rotation_log', 'rules', 'scaled_cost', 'self_collision_cost', 'self_collision_pairs', 'singular_sets_of', 'solve_batch', 'spline_velocities', 'sum_of_costs', 'taut_string']
DEFAULT_SCALE: float = 6.0
__version__: str

# ---- Status -----------------------------------------------------------------------------------------------------------
class Error(ValueError):
    """
    What set-up and checked calls refuse. The text carries the facts.
    """
class ArgumentError(Error, TypeError):
    """
    An argument that a call does not have, or lacks, or that is of a wrong type.
    """
class ModelWarning(UserWarning):
    """
    What set-up finds odd in a model or a start, and takes all the same.
    """
class Status(enum.IntEnum):
    """
    What a call did, ordered from the best to the worst. Degraded is not failed: everything below BAD_INPUT is finite, inside the stated bound, and may be sent to the arm.
    """
    BAD_INPUT = ...
    DAMPED = ...
    HOLDING = ...
    LIMITED = ...
    OK = ...
def planner_options() -> dict[str, typing.Any]:
    """
    The planners' options by the name of their struct: a tuple (name, type, default, doc) for each keyword.
    """
def pose_error(current: typing.Any, target: typing.Any) -> numpy.typing.NDArray[numpy.float64]:
    """
    [e_p; e_o] (6,) that takes `current` to `target` (4×4 poses in one frame).

    e_p [m] is the difference of the origins, e_o [rad] the axis-angle vector of R_target R_currentᵀ, both in the
    axes of that frame. Right up to and at a half turn.
    """
def rotation_exp(vector: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
    """
    Rotation (3, 3) about `vector` by its length [rad].
    """
def rotation_log(rotation: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
    """
    Axis times angle [rad] (3,) of a 3×3 rotation, angle in [0, π].
    """

# ---- Chain ------------------------------------------------------------------------------------------------------------
class JointLimits:
    """
    Limits of a chain's movable joints, (n,) each, infinite where there is none.
    """
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[int, bytes]:
        ...
    def __hash__(self) -> int:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple[typing.Any, ...]) -> None:
        ...
    @property
    def acceleration(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (n,) [rad/s² or m/s²]
        """
    @property
    def deceleration(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (n,) [rad/s² or m/s²], of a joint that becomes slower: the acceleration where none is given.
        """
    @property
    def effort(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (n,) [N·m or N]
        """
    @property
    def jerk(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (n,) [rad/s³ or m/s³]
        """
    @property
    def lower(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (n,) [rad or m]
        """
    @property
    def upper(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (n,) [rad or m]
        """
    @property
    def velocity(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (n,) [rad/s or m/s]
        """
class Inertia:
    """
    Mass distribution of a link, or of what the tip carries. Immutable.
    """
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[int, bytes]:
        ...
    def __hash__(self) -> int:
        ...
    def __init__(self, mass: typing.SupportsFloat | typing.SupportsIndex, center_of_mass: numpy.typing.ArrayLike = (0.0, 0.0, 0.0), tensor: numpy.typing.ArrayLike | None = None) -> None:
        """
        mass: [kg].
        center_of_mass: (3,) [m], in the link's frame.
        tensor: (3, 3) [kg·m²], about the centre of mass, in the link's axes; None: a point mass.

        Chains and Dynamics check the values.
        """
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple[typing.Any, ...]) -> None:
        ...
    @property
    def center_of_mass(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (3,) [m], in the link's frame
        """
    @property
    def mass(self) -> float:
        """
        [kg]
        """
    @property
    def tensor(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (3, 3) [kg·m²], about the centre of mass, in the link's axes
        """
class Segment:
    """
    A joint, fixed or movable, and the link that it carries. The link's frame is the joint's after the motion: parent ← origin · motion(axis, q).
    """
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[int, bytes]:
        ...
    def __hash__(self) -> int:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple[typing.Any, ...]) -> None:
        ...
    @property
    def axis(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (3,) unit vector in the joint's frame
        """
    @property
    def inertia(self) -> Inertia | None:
        """
        Of the link, None where it is not known.
        """
    @property
    def joint_name(self) -> str:
        """
        Name of the joint.
        """
    @property
    def link_name(self) -> str:
        """
        Name of the link.
        """
    @property
    def mimic(self) -> tuple[str, float, float] | None:
        """
        (joint, multiplier, offset) of a joint that moves with another: multiplier · (its position) + offset; else None.
        """
    @property
    def origin(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (4, 4) the joint's frame in the parent link, at q = 0
        """
    @property
    def type(self) -> str:
        """
        'fixed', 'revolute', 'continuous' or 'prismatic'.
        """
class Chain:
    """
    A serial arm: joints, limits and inertias between a base and a tip. Immutable, safe to share.

    Twists and Jacobians are [v; ω], in the axes of the base, at the tip's origin
    (Pinocchio's LOCAL_WORLD_ALIGNED). Poses are 4×4, tip in base.
    """
    @staticmethod
    def from_urdf(source: typing.Any, base: str | None = None, tip: str | None = None, acceleration: numpy.typing.ArrayLike | None = None) -> Chain:
        """
        Reads a URDF.

        source: a file's path, or the XML text.
        base, tip: link names; by default the root, and the only leaf.
        acceleration: (n,) limits [rad/s² or m/s²]; by default those of the file (URDF 1.2), else infinite.

        Raises Error with the facts for anything that is not a usable serial arm of 1 to 16 movable joints, and warns
        (ModelWarning) of velocity limits of zero, which count as none, of joints that mimic a joint beside the arm, which
        move by themselves, and of inertias that no rigid body has.
        """
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[int, bytes]:
        ...
    def __hash__(self) -> int:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple[typing.Any, ...]) -> None:
        ...
    def jacobian(self, q: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """
        Jacobian (6, n) at q (n,): rows [v; ω] in base axes at the tip's origin; (B, 6, n) at q (B, n).
        """
    def jacobian_gradient(self, q: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """
        ∂J/∂q_k (n, 6, n) at q (n,), k first; (B, n, 6, n) at q (B, n).
        """
    def lock(self, positions: collections.abc.Mapping[str, typing.SupportsFloat | typing.SupportsIndex]) -> Chain:
        """
        The same arm with joints that do not move any more: {name: position [rad or m]}. q has fewer entries.

        Links and inertias stay. Raises Error where a name is not in joint_names, a position is outside its limits,
        or no joint is left.
        """
    def missing_limits(self, *, velocity: bool = True, acceleration: bool = True) -> tuple[str, ...]:
        """
        Velocity and acceleration limits that joints lack, one sentence a kind: a servo cannot hold these.
        """
    def pose(self, q: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """
        Pose (4, 4) of the tip in the base at q (n,) [rad or m]; (B, 4, 4) at q (B, n).
        """
    def random_configuration(self, seed: typing.Any = None) -> typing.Any:
        """
        Positions (n,) drawn uniformly within the limits, within ±π where there are none.

        seed: what numpy.random.default_rng takes, a Generator included.
        """
    def with_limits(self, *, lower: numpy.typing.ArrayLike | None = None, upper: numpy.typing.ArrayLike | None = None, velocity: numpy.typing.ArrayLike | None = None, acceleration: numpy.typing.ArrayLike | None = None, deceleration: numpy.typing.ArrayLike | None = None, jerk: numpy.typing.ArrayLike | None = None, effort: numpy.typing.ArrayLike | None = None) -> Chain:
        """
        The same arm with other limits: (n,) or one number each, infinite for none; None keeps what there is.

        A continuous joint with a position limit (a cable) becomes a revolute joint. deceleration: of a joint that
        becomes slower; infinite: as the acceleration.
        """
    def with_tool(self, pose: typing.Any, inertia: Inertia | None = None) -> Chain:
        """
        The same arm with a tool, whose frame is the new tip.

        pose: (4, 4), the tool's frame in the tip.
        inertia: Inertia of the tool, in the tool's frame; Dynamics uses it. None: not known.
        """
    @property
    def base(self) -> str:
        """
        Name of the base link.
        """
    @property
    def characteristic_length(self) -> float:
        """
        [m] the lever arm of the joints that turn: the root mean square of the distance from a joint's axis
        to the tip, over these joints and over all turns of the joints after each (Angeles).
        """
    @property
    def dof(self) -> int:
        """
        Number of movable joints, n.
        """
    @property
    def joint_names(self) -> tuple[str, ...]:
        """
        Names of the movable joints, base to tip.
        """
    @property
    def joint_types(self) -> tuple[str, ...]:
        """
        'revolute', 'continuous' or 'prismatic' for every movable joint, base to tip.
        """
    @property
    def limits(self) -> JointLimits:
        """
        Limits of the movable joints.
        """
    @property
    def segments(self) -> tuple[Segment, ...]:
        """
        Everything between base and tip, fixed joints included.
        """
    @property
    def tip(self) -> str:
        """
        Name of the tip link.
        """
    @property
    def warnings(self) -> tuple[str, ...]:
        """
        What is wrong with the model and does not keep the arm from moving, one sentence each.
        """

# ---- Analytic IK ------------------------------------------------------------------------------------------------------
class AnalyticBranch:
    """
    One posture of a pose, from AnalyticIk.branches().
    """
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[int, bytes]:
        ...
    def __hash__(self) -> int:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple[typing.Any, ...]) -> None:
        ...
    @property
    def q(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (6,) [rad]
        """
    @property
    def singular(self) -> tuple[str, ...]:
        """
        Those of 'shoulder', 'elbow', 'wrist' where this branch and another have become one.
        """
    @property
    def within_limits(self) -> bool:
        """
        Every joint is within the chain's limits.
        """
class AnalyticIk:
    """
    Closed-form inverse kinematics of six revolute joints with a spherical wrist.

    Covers arms whose axes 4, 5, 6 meet in one point and whose axes 2 and 3 are parallel, to
    1e-9 [rad, or of the arm's size], however frames, signs and zeros are laid: offsets, and
    angles other than right ones, included. Immutable, safe to share.
    """
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[typing.Any, ...]:
        ...
    def __hash__(self) -> int:
        ...
    def __init__(self, chain: Chain) -> None:
        """
        Raises Error with the facts where the arm is not of this kind.
        """
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple[typing.Any, ...]) -> None:
        ...
    def branches(self, pose: typing.Any, *, within_limits: bool = False) -> list[AnalyticBranch]:
        """
        The postures of solve() in the same order, each with its limits and singularities.
        """
    def nearest(self, pose: typing.Any, q: numpy.typing.ArrayLike, *, within_limits: bool = False) -> numpy.typing.NDArray[numpy.float64] | None:
        """
        The posture (6,) [rad] of `pose` (4, 4) nearest to q (6,) by Euclidean norm; None where out of reach.

        One within the joint limits where there is one. within_limits: None where there is not.

        Each joint is on the turn nearest to q within its limits. An angle that is free at a singularity stays as
        in q, so that a path straight through is followed.
        """
    def singular(self, pose: typing.Any) -> tuple[str, ...]:
        """
        Those of 'shoulder', 'elbow', 'wrist' that any posture of `pose` (4, 4) is singular by; branches() tells
        which posture.
        """
    def solve(self, pose: typing.Any, *, within_limits: bool = False) -> numpy.typing.NDArray[numpy.float64]:
        """
        Every posture (k, 6) [rad] of `pose` (4, 4), tip in base: k ≤ 8, and 0 where it is out of reach.

        within_limits: leave out postures beyond a joint limit.

        Each joint is on the turn nearest to 0 within its limits, in (−π, π] where there is none. Branches that
        are one at a singularity are given once; an angle that is free there is as close to 0 as limits allow.
        """
    @property
    def chain(self) -> Chain:
        """
        The arm.
        """

# ---- Methods ----------------------------------------------------------------------------------------------------------
class Method:
    """
    A rule with its parameters: what a method does with each singular direction. The base class of all of them.

    Wherever a method is an argument, its name is accepted too: "jparse:gamma=0.2", see sigmaik.methods.
    """
    short_name: typing.ClassVar[str] = ''
    title: typing.ClassVar[str] = ''
    def __eq__(self, arg0: typing.Any) -> bool:
        ...
    def __hash__(self) -> int:
        ...
    def __reduce__(self) -> tuple[typing.Any, tuple[typing.Any, ...]]:
        ...
    def __repr__(self) -> str:
        ...
    @property
    def parameters(self) -> dict[str, typing.Any]:
        """
        The constructor's arguments by name.
        """
class JParse(Method):
    """
    J-PARSE (Guptasarma et al.): u_iᵀẋ/σ_i where σ_i > γσ_max, else σ_i/(γσ_max)² u_iᵀKẋ.

    Regular directions are exact; along a singular one motion fades out at the singularity and can leave it
    again. |q̇| ≤ |ẋ|/(γσ_max) for unit gains.
    """
    short_name: typing.ClassVar[str] = 'jparse'
    title: typing.ClassVar[str] = 'J-PARSE'
    def __init__(self, gamma: typing.SupportsFloat | typing.SupportsIndex = 0.1, gain_linear: typing.SupportsFloat | typing.SupportsIndex = 1.0, gain_angular: typing.SupportsFloat | typing.SupportsIndex = 1.0, continuous: bool = True, singular_posture: bool = False, adaptive: bool = True) -> None:
        """
        gamma: threshold in (0, 1] on σ_i/σ_max.
        gain_linear: the paper's K ≥ 0, for the command's linear rows.
        gain_angular: the paper's K ≥ 0, for the command's angular rows.
        continuous: the gain is K at σ_i = 0 and goes linearly to 1 at the threshold; False: K throughout,
            as published, which jumps at the threshold where K ≠ 1.
        singular_posture: the posture acts along singular directions, as far as J-PARSE's own inverse does
            not, by its I − J⁺J: an arm that was stretched out folds back to the side of its posture. False:
            the posture does not act there, as published.
        adaptive: the threshold is min(γσ_max, the σ_i that the command along u_i needs to stay within the
            arm's velocity and acceleration limits); False, and in a VelocitySolver: γσ_max, as published.
        """
    @property
    def adaptive(self) -> bool:
        """
        the threshold is min(γσ_max, the σ_i that the command along u_i needs to stay within the arm's velocity and acceleration limits); False, and in a VelocitySolver: γσ_max, as published.
        """
    @property
    def continuous(self) -> bool:
        """
        the gain is K at σ_i = 0 and goes linearly to 1 at the threshold; False: K throughout, as published, which jumps at the threshold where K ≠ 1.
        """
    @property
    def gain_angular(self) -> float:
        """
        the paper's K ≥ 0, for the command's angular rows.
        """
    @property
    def gain_linear(self) -> float:
        """
        the paper's K ≥ 0, for the command's linear rows.
        """
    @property
    def gamma(self) -> float:
        """
        threshold in (0, 1] on σ_i/σ_max.
        """
    @property
    def singular_posture(self) -> bool:
        """
        the posture acts along singular directions, as far as J-PARSE's own inverse does not, by its I − J⁺J: an arm that was stretched out folds back to the side of its posture. False: the posture does not act there, as published.
        """
class PseudoInverse(Method):
    """
    Moore and Penrose's inverse, truncated: u_iᵀẋ/σ_i, and 0 where σ_i ≤ tolerance·σ_max.

    The answer is exact, but joint speeds grow as 1/σ_i towards a singularity.
    """
    short_name: typing.ClassVar[str] = 'pinv'
    title: typing.ClassVar[str] = 'pseudo-inverse'
    def __init__(self, tolerance: typing.SupportsFloat | typing.SupportsIndex = 1e-12) -> None:
        """
        tolerance: fraction of σ_max in (0, 1] at and below which directions are dropped.
        """
    @property
    def tolerance(self) -> float:
        """
        fraction of σ_max in (0, 1] at and below which directions are dropped.
        """
class DampedLeastSquares(Method):
    """
    Constant damping: σ_i/(σ_i²+λ²) u_iᵀẋ (Wampler 1986; Nakamura and Hanafusa 1986).

    The answer is smooth, and inexact everywhere by λ²/(σ_i²+λ²). |q̇| ≤ |ẋ|/(2λ).
    """
    short_name: typing.ClassVar[str] = 'dls'
    title: typing.ClassVar[str] = 'damped least squares'
    def __init__(self, damping: typing.SupportsFloat | typing.SupportsIndex = 0.1) -> None:
        """
        damping: λ > 0, in the units of σ.
        """
    @property
    def damping(self) -> float:
        """
        λ > 0, in the units of σ.
        """
class AdaptiveDampedLeastSquares(Method):
    """
    Damping that grows towards a singularity and vanishes away from it. λ is `damping`, ε or w₀ `threshold`.

    rule 'numerical_filtering': only directions with σ_i < ε, λ_i² = (1 − (σ_i/ε)²) λ² (Maciejewski and Klein
        1988, as in Chiaverini 1997; the answer is continuous too where several directions are small)
    rule 'manipulability': all directions, λ² (1 − w/w₀)² where w = Π σ_i < w₀ (Nakamura and Hanafusa 1986)
    rule 'smallest_singular_value': all directions, (1 − (σ_min/ε)²) λ² where σ_min < ε (Chiaverini 1997)
    """
    short_name: typing.ClassVar[str] = 'adaptive-dls'
    title: typing.ClassVar[str] = 'adaptive damped least squares'
    def __init__(self, rule: typing.Literal['numerical_filtering', 'manipulability', 'smallest_singular_value'] = 'numerical_filtering', damping: typing.SupportsFloat | typing.SupportsIndex = 0.1, threshold: typing.SupportsFloat | typing.SupportsIndex | None = None, relative: bool = True) -> None:
        """
        rule: how the distance to a singularity is measured.
        damping: λ > 0 at the singularity.
        threshold: > 0; by default 0.1, or 1e-3 for 'manipulability'.
        relative: λ and ε are fractions of σ_max, w₀ of σ_max to the number of directions, so that units and
            size of the arm do not matter; False: absolute values, as in the papers.
        """
    @property
    def damping(self) -> float:
        """
        λ > 0 at the singularity.
        """
    @property
    def relative(self) -> bool:
        """
        λ and ε are fractions of σ_max, w₀ of σ_max to the number of directions, so that units and size of the arm do not matter; False: absolute values, as in the papers.
        """
    @property
    def rule(self) -> str:
        """
        how the distance to a singularity is measured.
        """
    @property
    def threshold(self) -> float | None:
        """
        > 0; by default 0.1, or 1e-3 for 'manipulability'.
        """
class SelectivelyDampedLeastSquares(Method):
    """
    Each direction clamped by what it moves the joints for what it moves the tip (Buss and Kim 2005).

    Their angle limit per update is a joint speed here. |q̇_j| ≤ max_speed.
    """
    short_name: typing.ClassVar[str] = 'sdls'
    title: typing.ClassVar[str] = 'selectively damped least squares'
    def __init__(self, max_speed: typing.SupportsFloat | typing.SupportsIndex = 0.7853981633974483) -> None:
        """
        max_speed: [rad/s] > 0 (the paper's γ_max).
        """
    @property
    def max_speed(self) -> float:
        """
        [rad/s] > 0 (the paper's γ_max).
        """
class JacobianProjection(Method):
    """
    Ablation of J-PARSE (eq. 62): u_iᵀẋ/σ_i where σ_i > γσ_max, else 0; the posture acts in the directions that are left out.
    """
    short_name: typing.ClassVar[str] = 'projection'
    title: typing.ClassVar[str] = 'ablation: projection'
    def __init__(self, gamma: typing.SupportsFloat | typing.SupportsIndex = 0.1) -> None:
        """
        gamma: threshold in (0, 1] on σ_i/σ_max.
        """
    @property
    def gamma(self) -> float:
        """
        threshold in (0, 1] on σ_i/σ_max.
        """
class JacobianSafety(Method):
    """
    Ablation of J-PARSE (eq. 63): u_iᵀẋ/max(σ_i, γσ_max).
    """
    short_name: typing.ClassVar[str] = 'safety'
    title: typing.ClassVar[str] = 'ablation: safety'
    def __init__(self, gamma: typing.SupportsFloat | typing.SupportsIndex = 0.1) -> None:
        """
        gamma: threshold in (0, 1] on σ_i/σ_max.
        """
    @property
    def gamma(self) -> float:
        """
        threshold in (0, 1] on σ_i/σ_max.
        """
class JacobianSafetyProjection(Method):
    """
    Ablation of J-PARSE (eq. 64): like JacobianProjection, but the posture does not act in the directions that are left out.
    """
    short_name: typing.ClassVar[str] = 'safety-projection'
    title: typing.ClassVar[str] = 'ablation: safety projection'
    def __init__(self, gamma: typing.SupportsFloat | typing.SupportsIndex = 0.1) -> None:
        """
        gamma: threshold in (0, 1] on σ_i/σ_max.
        """
    @property
    def gamma(self) -> float:
        """
        threshold in (0, 1] on σ_i/σ_max.
        """
def rules() -> tuple[type[Method], ...]:
    """
    The class of every rule, in the order of lists and tables.
    """

# ---- Solver -----------------------------------------------------------------------------------------------------------
class Spectrum:
    """
    Singular value decomposition J = U diag(σ) Vᵀ by one-sided Jacobi rotations.

    Keeps the last decomposition as a warm start, and as what singular vectors continue where they
    are not unique.
    """
    __hash__: typing.ClassVar[None] = None  # type: ignore[assignment]
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[int, bytes]:
        ...
    def __init__(self) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple[typing.Any, ...]) -> None:
        ...
    def decompose(self, J: numpy.typing.ArrayLike) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
        """
        U (m, m), σ (min(m, n),) from large to small, V (n, min(m, n)) of J (m, n), m ≤ 6, n ≤ 16.
        """
    @property
    def sweeps(self) -> int:
        """
        Sweeps of rotations that the last call took.
        """
class Solution:
    """
    Answer of VelocitySolver.solve().
    """
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[int, bytes]:
        ...
    def __hash__(self) -> int:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple[typing.Any, ...]) -> None:
        ...
    @property
    def achieved_twist(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (m,) J q̇, in the rows of the J that came in.
        """
    @property
    def directions(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (m', m') columns u_i in the task's rows, angular ones times length_scale.
        """
    @property
    def qdot(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (n,) [rad/s or m/s]
        """
    @property
    def singular(self) -> numpy.typing.NDArray[numpy.bool]:
        """
        (m',) truth values: the rule does not treat direction i as regular.
        """
    @property
    def singular_directions(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (m', k) the columns of `directions` that are singular to the rule.
        """
    @property
    def singular_values(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (min(m, n),) from large to small, of the weighted task Jacobian.
        """
    @property
    def status(self) -> Status:
        """
        Status.OK or Status.DAMPED.
        """
class VelocitySolver:
    """
    Resolves twists at given Jacobians by one method. Keeps only a warm start.
    """
    __hash__: typing.ClassVar[None] = None  # type: ignore[assignment]
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[typing.Any, ...]:
        ...
    def __init__(self, method: Method | str, length_scale: typing.SupportsFloat | typing.SupportsIndex = 1.0, mask: numpy.typing.ArrayLike | None = None, frame: str = 'base') -> None:
        """
        length_scale: [m] > 0; 1 rad/s weighs as much as length_scale m/s. In proportion to the arm, it makes
            answers independent of units and size.
        mask: which of the six rows (vx, vy, vz, ωx, ωy, ωz) matter; all by default.
        frame: the axes of these rows, 'base' or 'tool'.
        """
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple[typing.Any, ...]) -> None:
        ...
    def reset(self) -> None:
        """
        Forgets the warm start.
        """
    def set_joint_weights(self, weights: numpy.typing.ArrayLike | None) -> None:
        """
        How much each joint's motion counts: of all motions that move the tip as the rule says, the answer has the
        least Σ w_j (q̇_j − posture_j)². weights: (n,) > 0, only ratios matter; None: all 1.
        """
    def solve(self, J: numpy.typing.ArrayLike, twist: numpy.typing.ArrayLike, posture: numpy.typing.ArrayLike | None = None, rotation: numpy.typing.ArrayLike | None = None) -> Solution:
        """
        Joint velocities for a twist.

        J: (m, n), 1 ≤ m ≤ 6, 1 ≤ n ≤ 16. With six rows the mask applies; with as many rows as the mask asks for it
            is taken as masked. Without a mask, rows from the fourth on count as angular.
        twist: (m,) [m/s, rad/s].
        posture: (n,) q̇ [rad/s or m/s], goes through the method's own projector.
        rotation: (3, 3) tip in base, needed where frame is 'tool'.

        Raises Error where a shape is wrong or an entry is not finite.
        """
    @property
    def length_scale(self) -> float:
        """
        [m]
        """
    @property
    def method(self) -> Method:
        """
        The rule; may be changed.
        """
    @method.setter
    def method(self, arg1: Method | str) -> None:
        ...
def solve_batch(method: Method | str, J: numpy.typing.ArrayLike, twist: numpy.typing.ArrayLike, length_scale: typing.SupportsFloat | typing.SupportsIndex = 1.0, threads: typing.SupportsInt | typing.SupportsIndex = 1) -> numpy.typing.NDArray[numpy.float64]:
    """
    Joint velocities (B, n) for B independent problems, J (B, m, n) and twist (B, m), without the GIL.

    Each is solved as by a fresh VelocitySolver, to 1e-9, side by side in vector lanes. Order, B and number of threads
    do not change an answer.
    Raises Error where a shape is wrong or an entry is not finite.
    """

# ---- Collisions -------------------------------------------------------------------------------------------------------
class Capsule:
    """
    All points within `radius` [m] of the segment from a to b; a sphere where a = b.
    """
    def __init__(self, a: numpy.typing.ArrayLike, b: numpy.typing.ArrayLike, radius: typing.SupportsFloat | typing.SupportsIndex) -> None:
        """
        a, b: (3,) [m], the ends of the segment; radius [m] > 0.
        """
    def __repr__(self) -> str:
        ...
    @property
    def a(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (3,) [m]
        """
    @property
    def b(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (3,) [m]
        """
    @property
    def radius(self) -> float:
        """
        [m]
        """
class LinkCapsule:
    """
    A capsule that is fixed to a link.
    """
    def __init__(self, link: str, capsule: Capsule) -> None:
        """
        link: the link's name; capsule: in the link's frame.
        """
    def __repr__(self) -> str:
        ...
    @property
    def capsule(self) -> Capsule:
        """
        In the link's frame.
        """
    @property
    def excess(self) -> float:
        """
        [m], how far the capsule stands out from the shapes that it covers, at most; 0 where it was given, NaN where the shape is a mesh.
        """
    @property
    def link(self) -> str:
        """
        The link's name.
        """
class Obstacle:
    """
    A body of the world, in the axes of the arm's base: made by one of its makers.
    """
    @staticmethod
    def box(size: numpy.typing.ArrayLike, pose: numpy.typing.ArrayLike, *, name: str = '', links: collections.abc.Sequence[str] = []) -> Obstacle:
        """
        size (3,) [m] of its sides; pose: centre (3,) [m], or pose (4, 4).

        name: how the obstacle is called; links: those that have to keep clear, all by default.
        """
    @staticmethod
    def capsule(a: numpy.typing.ArrayLike, b: numpy.typing.ArrayLike, radius: typing.SupportsFloat | typing.SupportsIndex, *, name: str = '', links: collections.abc.Sequence[str] = []) -> Obstacle:
        """
        a, b (3,) [m], radius [m] > 0.

        name: how the obstacle is called; links: those that have to keep clear, all by default.
        """
    @staticmethod
    def cylinder(radius: typing.SupportsFloat | typing.SupportsIndex, length: typing.SupportsFloat | typing.SupportsIndex, pose: numpy.typing.ArrayLike, *, name: str = '', links: collections.abc.Sequence[str] = []) -> Obstacle:
        """
        radius, length [m] > 0, along its z; pose: centre (3,) [m], or pose (4, 4).

        name: how the obstacle is called; links: those that have to keep clear, all by default.
        """
    @staticmethod
    def half_space(point: numpy.typing.ArrayLike, normal: numpy.typing.ArrayLike, *, name: str = '', links: collections.abc.Sequence[str] = []) -> Obstacle:
        """
        The side of the plane through `point` (3,) [m] that `normal` (3,) points away from: a floor, a wall.

        name: how the obstacle is called; links: those that have to keep clear, all by default.
        """
    @staticmethod
    def sphere(center: numpy.typing.ArrayLike, radius: typing.SupportsFloat | typing.SupportsIndex, *, name: str = '', links: collections.abc.Sequence[str] = []) -> Obstacle:
        """
        center (3,) [m], radius [m] > 0.

        name: how the obstacle is called; links: those that have to keep clear, all by default.
        """
    def __repr__(self) -> str:
        ...
    @property
    def links(self) -> tuple[str, ...]:
        """
        The links that have to keep clear; empty: all that a joint moves.
        """
    @property
    def name(self) -> str:
        """
        Empty: obstacle i.
        """
    @property
    def pose(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (4, 4): capsules and cylinders lie along z, a half-space is z ≤ 0.
        """
    @property
    def shape(self) -> str:
        """
        'sphere', 'capsule', 'box', 'cylinder' or 'half-space'.
        """
    @property
    def size(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (3,) [m] sphere: radius; capsule: radius, length of the segment; box: sides; cylinder: radius, length.
        """
class Collisions:
    """
    What an arm must not touch: itself, and obstacles. For Servo(chain, collisions=…).

    Capsules cover the links' shapes; distances between capsules, and to obstacles, are exact. Pairs of links with two
    or more joints between them are checked, but for those that are near at nine of ten configurations. All servos
    with the same Collisions share its obstacles and its carried object.
    """
    def __copy__(self) -> Collisions:
        ...
    def __deepcopy__(self, memo: typing.Any) -> Collisions:
        ...
    def __init__(self, chain: Chain, obstacles: typing.Any = None, self_collision: bool = True, margin: typing.SupportsFloat | typing.SupportsIndex = 0.01, *, source: typing.Any = None, srdf: typing.Any = None, radius: typing.SupportsFloat | typing.SupportsIndex = 0.05, capsules: typing.SupportsInt | typing.SupportsIndex | None = None, ignore: collections.abc.Sequence[tuple[str, str]] = [], arm: collections.abc.Sequence[LinkCapsule] | None = None) -> None:
        """
        obstacles: up to 32 of Obstacle, or of the shapes Box, Sphere, Cylinder of sigmaik.planning, or an Obstacles of
            these; None: none.
        self_collision: whether the arm keeps clear of itself.
        margin: [m] ≥ 0, no pair of bodies comes closer.
        source: URDF with the links' shapes, a path or XML; None: what the chain was read from. Without a URDF, capsules
            run from each link's frame to the next.
        srdf: SRDF whose disable_collisions name pairs of links that need no check, a path or XML; None: none.
        radius: [m] > 0 of links with meshes, and without a URDF.
        capsules: the most that the arm gets, at least one a link; None: three more than joints.
        ignore: more pairs of links that need no check.
        arm: LinkCapsules of your own; None: capsules are fitted to the shapes.
        Raises Error where a number is out of its range, a link does not exist, or there are too many bodies.
        """
    def __repr__(self) -> str:
        ...
    def attach(self, capsules: collections.abc.Sequence[Capsule]) -> None:
        """
        Attaches an object of up to 4 capsules to the tip, in the tip's frame, in place of the one that the arm carries.
        """
    def detach(self) -> None:
        """
        Lets go of the object.
        """
    def distance(self, q: numpy.typing.ArrayLike) -> float | numpy.typing.NDArray[numpy.float64]:
        """
        The least distance [m] at q (n,), or (B,) at q (B, n); below 0: contact.
        """
    def move(self, i: typing.SupportsInt | typing.SupportsIndex, pose: numpy.typing.ArrayLike, twist: numpy.typing.ArrayLike | None = None) -> None:
        """
        Moves obstacle i, from any thread, for all servos that have these collisions.

        pose: (4, 4) in the base's axes, or the place of its origin (3,) [m].
        twist: (6,) [v; ω] of its origin, base axes: until the next call it goes on like this, for at most 0.2 s.
        Raises Error where there is no obstacle i, or the pose is none.
        """
    def nearest(self, q: numpy.typing.ArrayLike) -> tuple[float, str | None, str | None, numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
        """
        The nearest pair at q (n,): distance [m], the names of both bodies, and their nearest points (3,) [m] in base.
        """
    @property
    def body_names(self) -> tuple[str, ...]:
        """
        Names of the arm's capsules, of the carried ones, and of the obstacles: what step.nearest counts.
        """
    @property
    def capsules(self) -> list[LinkCapsule]:
        """
        The arm's LinkCapsules, base to tip.
        """
    @property
    def chain(self) -> Chain:
        """
        The arm.
        """
    @property
    def margin(self) -> float:
        """
        [m]
        """
    @property
    def obstacles(self) -> list[Obstacle]:
        """
        The obstacles, as given.
        """
    @property
    def self_pairs(self) -> list[tuple[int, int]]:
        """
        Pairs of the arm's capsules that are checked, by number.
        """

# ---- Servo ------------------------------------------------------------------------------------------------------------
class GuideState(enum.IntEnum):
    """
    What the guide of a Servo does for the pose target at hand (guided=True).
    """
    CHANGING_BRANCH = ...
    DIRECT = ...
    OFF = ...
    POSTURE = ...
    SEARCHING = ...
    UNREACHABLE = ...
class ServoStep:
    """
    Answer of one cycle of a Servo.
    """
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[int, bytes]:
        ...
    def __hash__(self) -> int:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple[typing.Any, ...]) -> None:
        ...
    @property
    def achieved_twist(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (6,) J q̇ [m/s, rad/s]
        """
    @property
    def asked_twist(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (6,) what the rule was given: the twist command, or the pose error's [m/s, rad/s]
        """
    @property
    def clearance(self) -> float:
        """
        [m] the least distance of all pairs of bodies after the step; inf where nothing is checked.
        """
    @property
    def guide(self) -> GuideState:
        """
        What the guide does, see GuideState.
        """
    @property
    def guide_joints(self) -> tuple[int, ...]:
        """
        Indices of the joints that end elsewhere by the guide's way than by the servo's own: by more than 0.5 rad, or half of the characteristic length.
        """
    @property
    def limited_by_collisions(self) -> bool:
        """
        Whether the step keeps clear of a body that the rule's answer would come too near to.
        """
    @property
    def limiting_joints(self) -> tuple[int, ...]:
        """
        Indices of the joints held at a limit that the rule's answer would break.
        """
    @property
    def nearest(self) -> tuple[int, int] | None:
        """
        The pair of this distance, by the numbers of Collisions.body_names; None: there is no pair.
        """
    @property
    def not_settling(self) -> bool:
        """
        The target has rested for longer than any motion takes (Servo.settling_time), and the arm still moves.
        """
    @property
    def pose_error(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (6,) [m, rad] target minus tip before the step, unshortened; zero for twist commands
        """
    @property
    def q(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (n,) position command [rad or m]
        """
    @property
    def qdot(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (n,) velocity command over the last dt [rad/s or m/s]
        """
    @property
    def scale(self) -> float:
        """
        In [0, 1], what limits left: of the rule's speed ('scale'), or of its twist along itself ('redistribute').
        """
    @property
    def singular(self) -> numpy.typing.NDArray[numpy.bool]:
        """
        (m',) truth values, one a row of the task: the rule does not treat direction i as regular.
        """
    @property
    def singular_directions(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (6, k) a column for each direction that is singular to the rule, in the order of `singular`.

        The twist [v; ω], base axes, at the tip's origin, that has u_i in the rows of the task and zero in the rows
        that the mask leaves out: |v|² + (length_scale |ω|)² = 1. The sign means nothing. None while holding.
        """
    @property
    def singular_values(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Singular values of the weighted task Jacobian, from large to small.
        """
    @property
    def status(self) -> Status:
        """
        What the cycle did, see Status.
        """
    @property
    def tool_speed(self) -> float:
        """
        [m/s] of the fastest checked point over the cycle; 0 without a max_tool_speed.
        """
    @property
    def tool_speed_limits(self) -> bool:
        """
        max_tool_speed has slowed the motion down.
        """
class Servo:
    """
    Drives a chain's reference configuration towards poses, or along twists, one cycle a call.

    It integrates its own command (q ← q + q̇ dt) and needs no measured positions (`measure`). Every command holds
    the chain's limits and leaves room to go on holding them; a start outside them comes back.
    """
    __hash__: typing.ClassVar[None] = None  # type: ignore[assignment]
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[typing.Any, ...]:
        ...
    def __init__(self, chain: Chain, method: Method | str | None = None, dt: typing.SupportsFloat | typing.SupportsIndex = 0.001, *, gain_linear: typing.SupportsFloat | typing.SupportsIndex = 10.0, gain_angular: typing.SupportsFloat | typing.SupportsIndex = 10.0, max_linear_error: typing.SupportsFloat | typing.SupportsIndex | None = None, max_angular_error: typing.SupportsFloat | typing.SupportsIndex = 1.0, soft_start: typing.SupportsFloat | typing.SupportsIndex = 0.1, posture: numpy.typing.ArrayLike | None = None, posture_gain: typing.SupportsFloat | typing.SupportsIndex = 0.0, posture_max_speed: typing.SupportsFloat | typing.SupportsIndex = ..., avoid: typing.Literal['manipulability', 'potential'] | None = None, avoid_gain: typing.SupportsFloat | typing.SupportsIndex = 1.0, avoid_max_speed: typing.SupportsFloat | typing.SupportsIndex = 0.5, eta1: typing.SupportsFloat | typing.SupportsIndex = 0.0, eta2: typing.SupportsFloat | typing.SupportsIndex = 10.0, position_limits: bool = True, velocity_limits: bool = True, acceleration_limits: bool = True, jerk_limits: bool = True, assumed_acceleration: typing.SupportsFloat | typing.SupportsIndex = 10.0, recovery_speed: typing.SupportsFloat | typing.SupportsIndex = 0.1, on_limit: typing.Literal['redistribute', 'scale'] = 'redistribute', exact: numpy.typing.ArrayLike | None = (0, 0, 0, 0, 0, 0), max_tool_speed: typing.SupportsFloat | typing.SupportsIndex = ..., speed_points: numpy.typing.ArrayLike | None = None, length_scale: typing.SupportsFloat | typing.SupportsIndex | None = None, joint_weights: numpy.typing.ArrayLike | None = None, guided: bool = False, collisions: Collisions | None = None, strict: bool = False, mask: numpy.typing.ArrayLike | None = (1, 1, 1, 1, 1, 1), frame: typing.Literal['base', 'tool'] = 'base') -> None:
        """
        Warns (ModelWarning) of velocity and acceleration limits that joints lack.

        method: None: JParse(), the best that there is.
        dt: [s] > 0, from one update to the next.
        gain_linear: [1/s] ≥ 0, from position error to velocity. (JParse's gain_linear is another thing: the
            paper's K.)
        gain_angular: [1/s] ≥ 0, from orientation error to angular velocity.
        max_linear_error: [m] > 0: longer position errors are shortened to it. None: half of length_scale.
        max_angular_error: [rad] > 0: longer orientation errors are shortened to it.
        soft_start: [s] ≥ 0 over which a pose target's command is faded in after reset(); twists only where
            reset() was told that the arm moves.
        posture: (n,) nominal positions [rad or m]; None: those given to reset().
        posture_gain: [1/s] ≥ 0, from the way to the posture to joint velocity.
        posture_max_speed: [rad/s or m/s] > 0, cap on each joint's.
        avoid: what keeps a redundant arm away from singularities: the gradient of the manipulability, or
            minus that of the potentials Σ exp(eta1 − eta2 ψ_i) around the known singular sets, is added to
            the posture's velocity.
        avoid_gain: ≥ 0, by which that gradient is multiplied.
        avoid_max_speed: [rad/s or m/s] > 0, of the fastest joint: longer velocities are shortened to it.
        eta1: of the potentials, at most 100.
        eta2: of the potentials, > 0.
        position_limits: whether the chain's position limits are held, now and so that they can be held for
            ever.
        velocity_limits: the same for its velocity limits.
        acceleration_limits: the same for its acceleration limits.
        jerk_limits: the same for its jerk limits.
        assumed_acceleration: [rad/s² or m/s²] > 0, the acceleration limit of joints whose model has none;
            inf: they have none.
        recovery_speed: in (0, 1], of the velocity limit: the least speed at which a joint that starts
            outside its position limits comes back.
        on_limit: what gives way at a position limit. 'redistribute': other joints take over, for the
            nearest twist that limits allow; 'scale': the direction is kept, speed is given up. At a
            velocity limit the direction is kept; 'redistribute' first uses the motion that does not move
            the tool.
        exact: (6,) truth values: the rows (vx, vy, vz, ωx, ωy, ωz) that come before the others in every
            cycle.
        max_tool_speed: [m/s] > 0: no checked point of the arm (the tip's origin, the origin of each movable
            joint's link, speed_points) moves faster in any cycle; the motion slows down along its
            direction. 0.25 is the reduced speed of ISO 10218-1. inf: no such limit.
        speed_points: (k, 3) [m] further points that max_tool_speed checks, in the tip's frame, k ≤ 8; None:
            none.
        length_scale: [m] > 0: 1 rad/s weighs as much as length_scale m/s, as for VelocitySolver. None:
            chain.characteristic_length.
        joint_weights: (n,) > 0, how much each joint's motion counts where there are more joints than rows:
            a rail with 1e4 moves only where the other joints cannot do the motion. Only ratios matter.
            None: all 1.
        guided: whether the servo takes another way to a pose target that rests where its own way does not
            arrive: through another configuration of the arm, if need be away from the tool's straight line.
            `step.guide` says so. Arrives at each target that PositionIk finds.
        collisions: what the arm must not touch: no command brings a pair of bodies nearer than the margin.
            None: nothing is checked.
        strict: whether `update` raises Error for a target that is no pose, in place of BAD_INPUT and a
            stop.
        mask: (6,) truth values: the rows (vx, vy, vz, ωx, ωy, ωz) that matter; None: all.
        frame: the axes of these rows, the base's or the tool's.
        """
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple[typing.Any, ...]) -> None:
        ...
    def continue_from(self, other: Servo) -> None:
        """
        Takes over from another servo of the same arm and dt, in the midst of its motion.

        Rule and options are this one's; what it commands is faded in from the other's last velocity over soft_start.
        """
    def hold(self, dt: typing.SupportsFloat | typing.SupportsIndex | None = None) -> ServoStep:
        """
        One cycle of the fastest stop that the limits allow, or of rest: HOLDING.

        dt: [s] the time since the last call, as for `update`.
        """
    def measure(self, q: numpy.typing.ArrayLike, qdot: numpy.typing.ArrayLike | None = None) -> None:
        """
        Tells the servo where the arm is, before `update`: in each cycle, or as often as the arm is measured.

        The pose error of `update` is then that of the arm and not that of the reference, through a low-pass filter of
        0.1 s: the tool arrives although the joints' controllers leave an error, and little of the noise enters the command.
        The command stays continuous and inside all limits, which hold for the reference.

        q: (n,) measured positions [rad or m].
        qdot: (n,) measured velocities, with which the filter does not lag; None: unknown.
        """
    def reset(self, q: numpy.typing.ArrayLike, qdot: numpy.typing.ArrayLike | None = None, qddot: numpy.typing.ArrayLike | None = None) -> None:
        """
        Starts, or starts again, at q (n,): forgets all history, and pins the posture there unless one was given.

        qdot: (n,) how the arm moves now, from which the command is faded; None: it stands.
        qddot: (n,) its acceleration, which matters to jerk limits. None: joints whose q and qdot are those of the last
            step keep the acceleration that the servo knows; of other joints none is assumed.
        To tell a running servo where the arm is, call `measure`.
        Warns (ModelWarning) of a joint that starts more than 1 rad or 1 m outside its limits.
        """
    def set_tool(self, tool: typing.Any) -> None:
        """
        Puts a tool on the tip from the next cycle on: targets, twists and poses are then those of its frame.

        tool: (4, 4) in the chain's tip; the identity takes the tool off. q̇ does not jump: the command is faded in
        from the last velocity over soft_start, inside all limits. For Dynamics use chain.with_tool(pose, inertia).
        """
    def update(self, target: typing.Any, feedforward: numpy.typing.ArrayLike | None = None, dt: typing.SupportsFloat | typing.SupportsIndex | None = None) -> ServoStep:
        """
        One cycle towards a pose (4, 4) of the tip in the base.

        feedforward: (6,) twist [v; ω] of a target that moves, base axes, at its origin, added to gain × error. Behind
            a target of constant twist the tip lags by speed/gain without it, and not at all with it.
        dt: [s] the time since the last call on the robot's clock, from a tenth to 20 times the servo's dt; None: the
            servo's dt. After a lost packet, or in a loop that is not even, the limits then hold against the clock: the
            position command advances by q̇ dt, and q̇ changes by no more than the acceleration limit times dt.
        Raises Error, and holds, where dt is outside its range.
        A matrix that is no pose (a rotation off by more than rounding, another last row) stops the arm: BAD_INPUT. With
            strict=True of the servo it raises Error, as arguments of a wrong shape or with NaN do in any case.
        """
    def update_twist(self, twist: numpy.typing.ArrayLike, frame: str = 'base', point: numpy.typing.ArrayLike | None = None, dt: typing.SupportsFloat | typing.SupportsIndex | None = None) -> ServoStep:
        """
        One cycle along a twist (6,) [v; ω].

        frame: the axes of twist and point, 'base' or 'tool'; jog devices send 'tool'.
        point: (3,) [m] that moves at v: in base, or with frame='tool' from the tip's origin. None: the tip's origin.
        dt: [s] the time since the last call, as for `update`.
        """
    @property
    def chain(self) -> Chain:
        ...
    @property
    def collisions(self) -> Collisions | None:
        """
        What the arm must not touch, or None.
        """
    @property
    def dt(self) -> float:
        """
        [s]
        """
    @property
    def following_error(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (n,) measured minus commanded position [rad or m], filtered; zero before `measure`.
        """
    @property
    def length_scale(self) -> float:
        """
        [m] 1 rad weighs as much as this length.
        """
    @property
    def method(self) -> Method:
        """
        The rule; may be changed between cycles.
        """
    @method.setter
    def method(self, arg1: Method | str) -> None:
        ...
    @property
    def options(self) -> dict[str, typing.Any]:
        """
        The options by keyword: with ** of them the constructor makes the same again.
        """
    @property
    def pose(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (4, 4) tip in base at q.
        """
    @property
    def q(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (n,) where the reference stands.
        """
    @property
    def rough_targets(self) -> int:
        """
        Targets of update() whose rotation was off by more than rounding (up to 9e-4 in RᵀR), and was made one.
        """
    @property
    def settling_time(self) -> float:
        """
        [s], after which a motion towards a target that rests is called not settling.
        """
    @property
    def tool(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (4, 4) of set_tool(), in the chain's tip.
        """

# ---- Servo batch ------------------------------------------------------------------------------------------------------
class ServoBatch:
    """
    Many servos of one arm, rule and options, a cycle of all of them in one call, without the GIL.

        batch = sk.ServoBatch(arm, None, 1e-2, 1024, threads=2)
        batch.reset(home)                       # (n,) for all; batch.reset(q, mask) starts some of them again
        batch.update(poses)                     # (B, 4, 4)
        batch.q, batch.qdot, batch.status       # (B, n), (B, n), (B,)

    Each servo does, to the last bit, what a Servo alone would do, and holds all limits. q, qdot, status, pose_error,
    achieved_twist and pose are views on arrays that the batch owns: each cycle overwrites them, `.copy()` keeps them, and
    what is written into them moves no servo. numpy.from_dlpack, torch.from_dlpack and others take them without a copy.
    """
    def __init__(self, chain: Chain, method: Method | str | None = None, dt: typing.SupportsFloat | typing.SupportsIndex = 0.001, size: typing.SupportsInt | typing.SupportsIndex = 1, threads: typing.SupportsInt | typing.SupportsIndex = 1, *, gain_linear: typing.SupportsFloat | typing.SupportsIndex = 10.0, gain_angular: typing.SupportsFloat | typing.SupportsIndex = 10.0, max_linear_error: typing.SupportsFloat | typing.SupportsIndex | None = None, max_angular_error: typing.SupportsFloat | typing.SupportsIndex = 1.0, soft_start: typing.SupportsFloat | typing.SupportsIndex = 0.1, posture: numpy.typing.ArrayLike | None = None, posture_gain: typing.SupportsFloat | typing.SupportsIndex = 0.0, posture_max_speed: typing.SupportsFloat | typing.SupportsIndex = ..., avoid: typing.Literal['manipulability', 'potential'] | None = None, avoid_gain: typing.SupportsFloat | typing.SupportsIndex = 1.0, avoid_max_speed: typing.SupportsFloat | typing.SupportsIndex = 0.5, eta1: typing.SupportsFloat | typing.SupportsIndex = 0.0, eta2: typing.SupportsFloat | typing.SupportsIndex = 10.0, position_limits: bool = True, velocity_limits: bool = True, acceleration_limits: bool = True, jerk_limits: bool = True, assumed_acceleration: typing.SupportsFloat | typing.SupportsIndex = 10.0, recovery_speed: typing.SupportsFloat | typing.SupportsIndex = 0.1, on_limit: typing.Literal['redistribute', 'scale'] = 'redistribute', exact: numpy.typing.ArrayLike | None = (0, 0, 0, 0, 0, 0), max_tool_speed: typing.SupportsFloat | typing.SupportsIndex = ..., speed_points: numpy.typing.ArrayLike | None = None, length_scale: typing.SupportsFloat | typing.SupportsIndex | None = None, joint_weights: numpy.typing.ArrayLike | None = None, guided: bool = False, collisions: Collisions | None = None, strict: bool = False, mask: numpy.typing.ArrayLike | None = (1, 1, 1, 1, 1, 1), frame: typing.Literal['base', 'tool'] = 'base') -> None:
        """
        Warns (ModelWarning) of velocity and acceleration limits that joints lack.

        method: None: JParse(), the best that there is.
        dt: [s] > 0, from one update to the next.
        size: B ≥ 1, number of servos.
        threads: ≥ 1, the most that work at once; never more than the machine has cores. The threads live as
            long as the batch, and the answers do not depend on their number.
        gain_linear: [1/s] ≥ 0, from position error to velocity. (JParse's gain_linear is another thing: the
            paper's K.)
        gain_angular: [1/s] ≥ 0, from orientation error to angular velocity.
        max_linear_error: [m] > 0: longer position errors are shortened to it. None: half of length_scale.
        max_angular_error: [rad] > 0: longer orientation errors are shortened to it.
        soft_start: [s] ≥ 0 over which a pose target's command is faded in after reset(); twists only where
            reset() was told that the arm moves.
        posture: (n,) nominal positions [rad or m]; None: those given to reset().
        posture_gain: [1/s] ≥ 0, from the way to the posture to joint velocity.
        posture_max_speed: [rad/s or m/s] > 0, cap on each joint's.
        avoid: what keeps a redundant arm away from singularities: the gradient of the manipulability, or
            minus that of the potentials Σ exp(eta1 − eta2 ψ_i) around the known singular sets, is added to
            the posture's velocity.
        avoid_gain: ≥ 0, by which that gradient is multiplied.
        avoid_max_speed: [rad/s or m/s] > 0, of the fastest joint: longer velocities are shortened to it.
        eta1: of the potentials, at most 100.
        eta2: of the potentials, > 0.
        position_limits: whether the chain's position limits are held, now and so that they can be held for
            ever.
        velocity_limits: the same for its velocity limits.
        acceleration_limits: the same for its acceleration limits.
        jerk_limits: the same for its jerk limits.
        assumed_acceleration: [rad/s² or m/s²] > 0, the acceleration limit of joints whose model has none;
            inf: they have none.
        recovery_speed: in (0, 1], of the velocity limit: the least speed at which a joint that starts
            outside its position limits comes back.
        on_limit: what gives way at a position limit. 'redistribute': other joints take over, for the
            nearest twist that limits allow; 'scale': the direction is kept, speed is given up. At a
            velocity limit the direction is kept; 'redistribute' first uses the motion that does not move
            the tool.
        exact: (6,) truth values: the rows (vx, vy, vz, ωx, ωy, ωz) that come before the others in every
            cycle.
        max_tool_speed: [m/s] > 0: no checked point of the arm (the tip's origin, the origin of each movable
            joint's link, speed_points) moves faster in any cycle; the motion slows down along its
            direction. 0.25 is the reduced speed of ISO 10218-1. inf: no such limit.
        speed_points: (k, 3) [m] further points that max_tool_speed checks, in the tip's frame, k ≤ 8; None:
            none.
        length_scale: [m] > 0: 1 rad/s weighs as much as length_scale m/s, as for VelocitySolver. None:
            chain.characteristic_length.
        joint_weights: (n,) > 0, how much each joint's motion counts where there are more joints than rows:
            a rail with 1e4 moves only where the other joints cannot do the motion. Only ratios matter.
            None: all 1.
        guided: whether the servo takes another way to a pose target that rests where its own way does not
            arrive: through another configuration of the arm, if need be away from the tool's straight line.
            `step.guide` says so. Arrives at each target that PositionIk finds.
        collisions: what the arm must not touch: no command brings a pair of bodies nearer than the margin.
            None: nothing is checked.
        strict: whether `update` raises Error for a target that is no pose, in place of BAD_INPUT and a
            stop.
        mask: (6,) truth values: the rows (vx, vy, vz, ωx, ωy, ωz) that matter; None: all.
        frame: the axes of these rows, the base's or the tool's.
        """
    def __len__(self) -> int:
        ...
    def __repr__(self) -> str:
        ...
    def reset(self, q: numpy.typing.ArrayLike, mask: numpy.typing.ArrayLike | None = None, qdot: numpy.typing.ArrayLike | None = None) -> None:
        """
        Starts servos, or starts them again, at q: (n,) for all, or (B, n) with a row for each.

        mask: (B,) truth values, the servos to start; None: all. The other rows of q are not read.
        qdot: (n,) or (B, n) how the arms move now; None: they rest.
        Where an entry that is read is not finite, Error is raised and nothing has changed.
        """
    def servo(self, index: typing.SupportsInt | typing.SupportsIndex) -> Servo:
        """
        A copy of one servo as it is now, with all of its history.
        """
    def update(self, poses: numpy.typing.ArrayLike, feedforward: numpy.typing.ArrayLike | None = None) -> ServoBatch:
        """
        One cycle of every servo towards poses (B, 4, 4) of the tip in the base, without the GIL. Returns the batch.

        feedforward: (B, 6) twists [v; ω] of targets that move, base axes, at the target's origin.
        A row that is not a pose stops its own servo, whose status is BAD_INPUT, and no other. Wrong shapes raise Error.
        Arrays of float64 in C order are read where they are; others are copied first.
        """
    def update_twist(self, twists: numpy.typing.ArrayLike, frame: str = 'base') -> ServoBatch:
        """
        One cycle of every servo along twists (B, 6) [v; ω] of the tips' origins, without the GIL. Returns the batch.

        frame: the axes of the twists, 'base' or 'tool'.
        A row that is not finite stops its own servo, whose status is BAD_INPUT, and no other.
        """
    @property
    def achieved_twist(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (B, 6) J q̇ [m/s, rad/s].
        """
    @property
    def chain(self) -> Chain:
        ...
    @property
    def dt(self) -> float:
        """
        [s]
        """
    @property
    def method(self) -> Method:
        ...
    @property
    def options(self) -> dict[str, typing.Any]:
        """
        The options by keyword: with ** of them the constructor makes the same again.
        """
    @property
    def pose(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (B, 4, 4) the tips in the base, at q.
        """
    @property
    def pose_error(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (B, 6) [m, rad] target minus tip before the cycle; zero for twists.
        """
    @property
    def q(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (B, n) position commands [rad or m]; NaN before the first reset.
        """
    @property
    def qdot(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (B, n) velocity commands over the last dt [rad/s or m/s].
        """
    @property
    def size(self) -> int:
        """
        B.
        """
    @property
    def status(self) -> numpy.typing.NDArray[numpy.int8]:
        """
        (B,) int8, a Status for each servo.
        """
    @property
    def threads(self) -> int:
        """
        Threads that work at once.
        """

# ---- Servo loop -------------------------------------------------------------------------------------------------------
class LoopCommand(enum.IntEnum):
    """
    What a cycle of a ServoLoop followed.
    """
    HOLD = ...
    POSE = ...
    STALE = ...
    TWIST = ...
class LoopState(enum.IntEnum):
    """
    What a ServoLoop does.

    DISABLED: no thread runs. HOLDING: no command, or a stale one. FOLLOWING: a command.
    STOPPING: stop(), halt() or a fault brings the arm to rest. STOPPED: at rest after halt(), until release().
    FAULTED: at rest after a fault, until acknowledge().
    """
    DISABLED = ...
    FAULTED = ...
    FOLLOWING = ...
    HOLDING = ...
    STOPPED = ...
    STOPPING = ...
class LoopFaultKind(enum.IntEnum):
    """
    Why a ServoLoop stopped the arm by itself.

    SINK: the function that sends the commands threw. LATE: more than max_missed cycles were left out in one go.
    FOLLOWING_ERROR: a joint was measured too far from its command. UNMEASURED: no measure() came in time.
    """
    FOLLOWING_ERROR = ...
    LATE = ...
    SINK = ...
    UNMEASURED = ...
class LoopFault:
    """
    The first fault of a ServoLoop since the last acknowledge().
    """
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[typing.Any, ...]:
        ...
    def __hash__(self) -> int:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple[typing.Any, ...]) -> None:
        ...
    @property
    def joint(self) -> int:
        """
        of a following error; else −1.
        """
    @property
    def kind(self) -> LoopFaultKind:
        ...
    @property
    def text(self) -> str:
        """
        The cause with its figures.
        """
    @property
    def time(self) -> float:
        """
        [s] since start().
        """
class LoopToken:
    """
    Names the owner of an arm to its ServoLoop: see ServoLoop.take.
    """
    def __eq__(self, arg0: typing.Any) -> bool:
        ...
    def __hash__(self) -> int:
        ...
    def __repr__(self) -> str:
        ...
class LoopStatistics:
    """
    How a ServoLoop keeps its rate.
    """
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[typing.Any, ...]:
        ...
    def __hash__(self) -> int:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple[typing.Any, ...]) -> None:
        ...
    @property
    def cycles(self) -> int:
        ...
    @property
    def elapsed(self) -> float:
        """
        [s] since start(), or from start() to stop().
        """
    @property
    def missed(self) -> int:
        """
        Cycles left out, as their time had passed.
        """
    @property
    def rate(self) -> float:
        """
        [Hz] cycles a second.
        """
    @property
    def rough_targets(self) -> int:
        """
        Poses of follow() whose rotation was off by more than rounding, and was made one.
        """
    @property
    def sink_errors(self) -> int:
        """
        Exceptions of the sink.
        """
    @property
    def unread(self) -> int:
        """
        Samples lost, as nobody read them in time.
        """
    @property
    def worst_delay(self) -> float:
        """
        [s] from when a cycle was due to its start.
        """
class ServoLoop:
    """
    A servo in a thread of its own, at its own rate, whatever Python does meanwhile.

    Commands hold until they are stale: an arm whose commander hangs, or is gone, stops by itself, within its
    limits. Late cycles are counted and left out, never made up for by a burst; where too many are late, the arm stops.

    No motion without a new command: start(), release(), take() and give_back() forget the earlier ones. After
    os.fork() no loop runs in the child.
    """
    def __enter__(self) -> typing.Any:
        ...
    def __exit__(self, type: typing.Any, value: typing.Any, traceback: typing.Any) -> None:
        ...
    def __init__(self, servo: Servo, *, history: typing.SupportsInt | typing.SupportsIndex = 4096, priority: typing.SupportsInt | typing.SupportsIndex = 0, max_missed: typing.SupportsInt | typing.SupportsIndex | None = None, max_following_error: numpy.typing.ArrayLike | None = None, measure_timeout: typing.SupportsFloat | typing.SupportsIndex | None = None) -> None:
        """
        servo: has started (reset); it is copied.
        history: samples kept for read(), a power of 2.
        priority: of SCHED_FIFO, 1 to 99; 0 is the ordinary scheduler.
        max_missed: cycles left out in one go, beyond which the arm stops with a fault; None: the cycles of
            one second.
        max_following_error: (n,) [rad or m]: a joint measured farther than this from its command stops the
            arm with a fault; None: no check.
        measure_timeout: [s]: this time without measure(), from start() on, stops the arm with a fault;
            None: no check.
        """
    def __repr__(self) -> str:
        ...
    def acknowledge(self) -> None:
        """
        Forgets the fault. The arm stays halted, until release(). Raises Error where the arm does not rest yet.
        """
    def configure(self, servo: Servo, restart: bool = False, token: LoopToken | None = None) -> int:
        """
        Goes on with another servo (a copy) of the same arm and dt: other rule, other options.

        The new servo takes over the motion. With `restart` it starts where it was reset to: in simulation, or
        where the arm rests there already. Any other arm jumps.
        Returns a number, one more each time, by which samples tell it; 0 is the first servo's.
        """
    def follow(self, target: typing.Any, timeout: typing.SupportsFloat | typing.SupportsIndex, token: LoopToken | None = None) -> None:
        """
        Follows a pose (4, 4) of the tip in the base, for `timeout` [s] (up to 60) unless it is said again.

        Raises Error where the loop does not run, is halted, stopping or faulted, or somebody else owns the arm.
        """
    def follow_twist(self, twist: numpy.typing.ArrayLike, timeout: typing.SupportsFloat | typing.SupportsIndex, token: LoopToken | None = None) -> None:
        """
        Follows a twist (6,) [v; ω], base axes, at the tip's origin, for `timeout` [s] (up to 60) unless it is said again.

        Raises Error as follow() does.
        """
    def give_back(self, token: LoopToken) -> bool:
        """
        Gives the arm back, and stops it. Returns False where the token is not the owner's, and changes nothing.
        """
    def halt(self) -> None:
        """
        Stops the arm as fast as its limits allow, and latches: the arm rests until release(), whoever commands.
        """
    def hold(self) -> None:
        """
        Stops as fast as limits allow, and rests until the next command.
        """
    def measure(self, q: numpy.typing.ArrayLike, qdot: numpy.typing.ArrayLike | None = None) -> bool:
        """
        Tells the loop where the arm is: q and qdot (n,), as often as they are measured, from one thread.

        The next cycle compares q with the command (max_following_error), and gives both to Servo.measure.
        Returns False where the loop does not run, or another thread is just measuring.
        """
    def read(self) -> numpy.ndarray:
        """
        (N,) structured array: what was done in each cycle since the last call.

        cycle, time [s] since start(), command (LoopCommand), configuration, state (LoopState), restarted, status (Status), q and qdot (n,), target and
        pose (4, 4) of the tip, pose_error, asked_twist and achieved_twist (6,), singular_values (NaN while holding),
        singular (bits), singular_directions (6, 6) (ServoStep's columns, NaN beyond them), limiting_joints (bits),
        scale, guide (GuideState), guide_joints (bits).
        """
    def release(self, token: LoopToken | None = None) -> None:
        """
        Opens the latch of halt(), or of a fault that is acknowledged. The arm rests until a new command comes.

        Raises Error where the arm does not rest yet, a fault is not acknowledged, or somebody else owns the arm.
        """
    def set_tool(self, tool: typing.Any, token: LoopToken | None = None) -> None:
        """
        Puts a tool (4, 4) on the tip from the next cycle on, without a jump: see Servo.set_tool.

        The live command goes on, and is then the tool's.
        """
    def start(self) -> None:
        """
        Starts the thread. The arm rests until a command comes: commands from before are forgotten.

        Raises Error where the loop runs already, a fault is not acknowledged, or the system refuses the priority.
        """
    def stop(self, timeout: typing.SupportsFloat | typing.SupportsIndex | None = None) -> bool:
        """
        Brings the arm to rest by the fastest stop that its limits allow, and then ends the thread.

        Waits for `timeout` [s], 0 to 60, at most; None: `stop_time`. Returns whether the arm rests and no thread runs; where it
        does not, the thread goes on stopping the arm, and ends by itself.
        """
    def take(self, name: str, take_over: bool = False) -> LoopToken:
        """
        Makes the caller the arm's owner; a live command is forgotten.

        Until give_back(), follow(), follow_twist(), configure() and release() need the token that is returned; anyone may
        stop(), halt() and hold() the arm. Raises Error where the arm has an owner, unless it is taken over.
        """
    @property
    def dt(self) -> float:
        """
        [s]
        """
    @property
    def fault(self) -> LoopFault | None:
        """
        The fault that stopped the arm, until acknowledge(); or None.
        """
    @property
    def halted(self) -> bool:
        """
        Whether the latch of halt(), or of a fault, is closed: also while no thread runs.
        """
    @property
    def owner(self) -> str:
        """
        The owner's name; '' where nobody owns the arm.
        """
    @property
    def running(self) -> bool:
        """
        Whether the thread runs, in this process.
        """
    @property
    def state(self) -> LoopState:
        """
        The LoopState that the last cycle and the calls since have left.
        """
    @property
    def statistics(self) -> LoopStatistics:
        ...
    @property
    def stop_time(self) -> float:
        """
        [s] for which stop() waits at most, from the arm's limits.
        """

# ---- Target stream ----------------------------------------------------------------------------------------------------
class StreamStatus(enum.IntEnum):
    """
    What a target is, ordered from the best to the worst.
    """
    COASTING = ...
    STALE = ...
    TRACKING = ...
    WAITING = ...
class SampleStatus(enum.IntEnum):
    """
    What became of a sample.
    """
    ACCEPTED = ...
    AHEAD = ...
    INVALID = ...
    OUTLIER = ...
    OUT_OF_ORDER = ...
    RELOCATED = ...
class SampleCounts:
    """
    How many samples had which fate.
    """
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[int, bytes]:
        ...
    def __hash__(self) -> int:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple[typing.Any, ...]) -> None:
        ...
    @property
    def accepted(self) -> int:
        """
        Relocated ones included.
        """
    @property
    def ahead(self) -> int:
        """
        Samples whose stamp was ahead of the clock of at().
        """
    @property
    def clock_steps(self) -> int:
        """
        Steps of the clock of at(), and of the stamps against this clock.
        """
    @property
    def invalid(self) -> int:
        ...
    @property
    def out_of_order(self) -> int:
        ...
    @property
    def outliers(self) -> int:
        ...
    @property
    def relocated(self) -> int:
        ...
    @property
    def rough(self) -> int:
        """
        Samples whose rotation was off by more than rounding.
        """
class Target:
    """
    Where to be now, and how to move: servo.update(target.pose, target.twist).
    """
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[int, bytes]:
        ...
    def __hash__(self) -> int:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple[typing.Any, ...]) -> None:
        ...
    @property
    def age(self) -> float:
        """
        [s] since the newest sample was taken; 0 before the first.
        """
    @property
    def pose(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (4, 4) in base.
        """
    @property
    def status(self) -> StreamStatus:
        """
        See StreamStatus.
        """
    @property
    def twist(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (6,) derivative of the pose: [v; ω], base axes, at its origin.
        """
class TargetStream:
    """
    The way from a sensor to a servo: stamped samples of a pose in, one smooth target a cycle out.

        stream.push(stamp, pose)                     # whenever there is one: stamp = when it was taken
        target = stream.at(now)                      # each cycle, on the same clock
        servo.update(target.pose, target.twist)

    Samples may come late, doubled, wrong or not at all. Targets are continuous, with their twist, and never faster
    than max_speed and max_angular_speed: not when a sample arrives, not when the stream stops or starts again, not
    when the target is found elsewhere.
    """
    __hash__: typing.ClassVar[None] = None  # type: ignore[assignment]
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[typing.Any, ...]:
        ...
    def __init__(self, mode: typing.Literal['hold', 'interpolate', 'predict'] = 'predict', *, max_speed: typing.SupportsFloat | typing.SupportsIndex = 1.5, max_angular_speed: typing.SupportsFloat | typing.SupportsIndex = 4.0, smoothing: typing.SupportsFloat | typing.SupportsIndex = 0.05, latency: typing.SupportsFloat | typing.SupportsIndex = 0.1, horizon: typing.SupportsFloat | typing.SupportsIndex = 0.1, timeout: typing.SupportsFloat | typing.SupportsIndex = 0.3, noise_linear: typing.SupportsFloat | typing.SupportsIndex = 0.002, noise_angular: typing.SupportsFloat | typing.SupportsIndex = 0.01, acceleration_linear: typing.SupportsFloat | typing.SupportsIndex = 3.0, acceleration_angular: typing.SupportsFloat | typing.SupportsIndex = 10.0, relocate: typing.SupportsInt | typing.SupportsIndex = 5) -> None:
        """
        mode: where the target is between samples, and after the last one. 'hold': at the last sample, for
            devices that send only changes; 'interpolate': on a smooth curve through the samples, `latency`
            ago; 'predict': where a constant-velocity Kalman filter expects it now.
        max_speed: [m/s] > 0: nothing is faster; a sample that would have to be is an outlier.
        max_angular_speed: [rad/s] > 0, likewise.
        smoothing: [s] ≥ 0, time constant of the way from where the target is to where a new sample says it
            is; at 0 the twist jumps.
        latency: [s] ≥ 0: 'interpolate' plays so late: the sensor's delay, and one or two samples.
        horizon: [s] ≥ 0: so long after its last sample the target moves on as it did, …
        timeout: [s] ≥ horizon, > 0: … and by then it has come to rest, and the stream is stale.
        noise_linear: [m] > 0, standard deviation of a sample, each axis.
        noise_angular: [rad] > 0, likewise.
        acceleration_linear: [m/s²] > 0, standard deviation of what the target may do between samples.
        acceleration_angular: [rad/s²] > 0, likewise.
        relocate: ≥ 1: so many refused samples in a row that agree with each other are believed.
        """
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple[typing.Any, ...]) -> None:
        ...
    def at(self, time: typing.SupportsFloat | typing.SupportsIndex) -> Target:
        """
        The target at a time [s]. Where the clock steps, back or forth, the target holds still: STALE, twist zero;
        samples of the new clock lead on from there.
        """
    def push(self, time: typing.SupportsFloat | typing.SupportsIndex, pose: typing.Any) -> SampleStatus:
        """
        A sample: when it was taken [s], and the pose (4, 4) then. Raises Error where it is not a pose.
        """
    def reset(self, start: typing.Any = None) -> None:
        """
        Forgets everything. The next target is at `start` (4, 4), such as the tip's pose, and goes to the samples from
        there; with None it is where the first sample is.
        """
    @property
    def counts(self) -> SampleCounts:
        """
        How many samples had which fate.
        """
    @property
    def options(self) -> dict[str, typing.Any]:
        """
        The options by keyword: with ** of them the constructor makes the same again.
        """

# ---- Action chunks ----------------------------------------------------------------------------------------------------
class ActionStatus(enum.IntEnum):
    """
    What the target of ActionChunks does, ordered from the best to the worst.
    """
    BLENDING = ...
    LATE = ...
    STARVED = ...
    TRACKING = ...
    WAITING = ...
class ChunkStatus(enum.IntEnum):
    """
    What became of a chunk of actions.
    """
    ACCEPTED = ...
    EXPIRED = ...
    INVALID = ...
    OUT_OF_ORDER = ...
class ChunkCounts:
    """
    How many chunks and actions had which fate.
    """
    def __repr__(self) -> str:
        ...
    @property
    def accepted(self) -> int:
        ...
    @property
    def expired(self) -> int:
        ...
    @property
    def fast(self) -> int:
        """
        Actions that need more than max_speed or max_angular_speed: they are followed late.
        """
    @property
    def invalid(self) -> int:
        ...
    @property
    def missed(self) -> int:
        """
        Actions of accepted chunks whose time was over when the chunk came.
        """
    @property
    def out_of_order(self) -> int:
        ...
    @property
    def rough(self) -> int:
        """
        Actions whose rotation was off by more than rounding.
        """
class ActionTarget:
    """
    Where to be now, and how to move: servo.update(target.pose, target.twist); or pose, twist, status = target.
    """
    def __iter__(self) -> collections.abc.Iterator[typing.Any]:
        ...
    def __repr__(self) -> str:
        ...
    @property
    def age(self) -> float:
        """
        [s] since the stamp of the chunk; 0 before the first.
        """
    @property
    def behind(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (6,) [m, rad] what is not done: from the target to where the newest chunk is at this time, base axes.
        """
    @property
    def left(self) -> float:
        """
        [s] until the last action of the chunk; negative after it.
        """
    @property
    def pose(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (4, 4) in base.
        """
    @property
    def status(self) -> ActionStatus:
        """
        See ActionStatus.
        """
    @property
    def twist(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (6,) derivative of the pose: [v; ω], base axes, at its origin.
        """
class ActionChunks:
    """
    The way from a policy to a servo: chunks of actions in, one smooth target a cycle out.

        chunks = sk.ActionChunks(0.1)                # actions at 10 Hz
        chunks.reset(servo.pose)
        chunks.push(stamp, poses)                    # (k, 4, 4); stamp = when the observation was made
        pose, twist, status = chunks.at(now)         # each cycle, on the same clock
        servo.update(pose, twist)

    Chunks may come late, overlap, or not at all. Action i is for the time stamp + first + i dt_action: what is over
    is not done again. Pose, twist and acceleration of the target are continuous, speed, acceleration and jerk are
    bounded, and where no chunk comes the target comes to rest at the last action.
    """
    def __init__(self, dt_action: typing.SupportsFloat | typing.SupportsIndex = 0.1, *, first: typing.SupportsFloat | typing.SupportsIndex = 0.0, smoothing: typing.SupportsFloat | typing.SupportsIndex = 0.1, max_speed: typing.SupportsFloat | typing.SupportsIndex = 1.5, max_angular_speed: typing.SupportsFloat | typing.SupportsIndex = 4.0, stop_time: typing.SupportsFloat | typing.SupportsIndex = 0.3, max_actions: typing.SupportsInt | typing.SupportsIndex = 128) -> None:
        """
        dt_action: [s] > 0, from one action of a chunk to the next.
        first: [s] from the stamp of a chunk to the time of its first action: 0 where the first action is
            for the time of the observation, dt_action where it is for the step after it.
        smoothing: [s] ≥ 0: the difference that a new chunk makes decays to a tenth in 3.9 smoothing; the
            jerk is at most 4.2 max_speed/smoothing².
        max_speed: [m/s] > 0: the target is never faster.
        max_angular_speed: [rad/s] > 0, likewise.
        stop_time: [s] ≥ 0: so long takes the stop at the last action of a chunk that no other has replaced;
            it begins half as long before that action.
        max_actions: 1 to 10000: longer chunks are refused.
        """
    def __repr__(self) -> str:
        ...
    def at(self, time: typing.SupportsFloat | typing.SupportsIndex) -> ActionTarget:
        """
        The target at a time [s] not before that of the last call; else the last one again.
        """
    def push(self, stamp: typing.SupportsFloat | typing.SupportsIndex, poses: numpy.typing.ArrayLike) -> ChunkStatus:
        """
        A chunk of poses (k, 4, 4) of the tip in base. stamp: [s] when its observation was made.

        Raises Error where a pose is none; what else is refused the answer says.
        """
    def push_twists(self, stamp: typing.SupportsFloat | typing.SupportsIndex, twists: numpy.typing.ArrayLike) -> ChunkStatus:
        """
        A chunk of twists (k, 6) [v; ω], base axes, at the tip's origin; it starts where the target is.

        Twist i is the mean from stamp + first + i dt_action to the next. It needs a start: reset(start), or a chunk of
        poses before it.
        """
    def reset(self, start: typing.Any = None) -> None:
        """
        Forgets everything. The next target is at `start` (4, 4), such as the tip's pose, and goes to the chunks from
        there; with None it is where the first chunk is.
        """
    @property
    def counts(self) -> ChunkCounts:
        """
        How many chunks and actions had which fate.
        """
    @property
    def options(self) -> dict[str, typing.Any]:
        """
        The options by keyword: with ** of them the constructor makes the same again.
        """

# ---- Dynamics ---------------------------------------------------------------------------------------------------------
class Dynamics:
    """
    Rigid-body dynamics M(q) q̈ + C(q, q̇) q̇ + g(q) = τ of a chain with what it carries, by KDL.
    """
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[typing.Any, ...]:
        ...
    def __hash__(self) -> int:
        ...
    def __init__(self, chain: Chain, gravity: numpy.typing.ArrayLike | None = None, payload: Inertia | None = None) -> None:
        """
        gravity: (3,) [m/s²] in base axes; by default 9.80665 m/s² along −z.
        payload: what the tip carries, in the tip's frame.

        Raises Error where a movable joint carries no link whose inertia is known, and where the payload is no body:
        a mass below 0, a tensor that is not symmetric, a principal moment beyond the sum of the other two.
        """
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple[typing.Any, ...]) -> None:
        ...
    def coriolis(self, q: numpy.typing.ArrayLike, qdot: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """
        C(q, q̇) q̇ (n,) [N·m] at q and q̇ (n,).
        """
    def forward_dynamics(self, q: numpy.typing.ArrayLike, qdot: numpy.typing.ArrayLike, torque: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """
        q̈ = M⁻¹ (τ − C q̇ − g) (n,) [rad/s² or m/s²] at q, q̇ (n,) under τ (n,) [N·m].

        Raises Error where M is not positive definite.
        """
    def gravity(self, q: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """
        g (n,) [N·m] at q (n,): the torques that hold the arm.
        """
    def inverse_dynamics(self, q: numpy.typing.ArrayLike, qdot: numpy.typing.ArrayLike, qddot: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """
        τ = M q̈ + C q̇ + g (n,) [N·m] at q, q̇, q̈ (n,), by one recursion of Newton and Euler.
        """
    def mass_matrix(self, q: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """
        M (n, n) [kg·m²] at q (n,).
        """
    @property
    def dof(self) -> int:
        """
        Number of movable joints, n.
        """
class ComputedTorqueStep:
    """
    Answer of one cycle of a ComputedTorque.
    """
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[int, bytes]:
        ...
    def __hash__(self) -> int:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple[typing.Any, ...]) -> None:
        ...
    @property
    def limiting_joints(self) -> tuple[int, ...]:
        """
        Indices of the joints whose torque would break its limit.
        """
    @property
    def scale(self) -> float:
        """
        In [0, 1], the part of v that effort limits leave.
        """
    @property
    def status(self) -> Status:
        """
        OK, or LIMITED where an effort limit would be broken.
        """
    @property
    def torque(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (n,) [N·m or N], within the chain's effort limits
        """
class ComputedTorque:
    """
    Computed torque control: τ = M(q) v + C(q, q̇) q̇ + g(q), v = q̈_d + 2ζω ė + ω² e, e = q_d − q.

    With the true model every joint's error obeys ë + 2ζω ė + ω² e = 0 by itself (Beck et al. 2022,
    eqs. 18 to 20). Where an effort limit of the chain would be broken, v is scaled down in all joints alike.
    """
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[typing.Any, ...]:
        ...
    def __hash__(self) -> int:
        ...
    def __init__(self, chain: Chain, *, frequency: typing.SupportsFloat | typing.SupportsIndex = 20.0, damping_ratio: typing.SupportsFloat | typing.SupportsIndex = 1.0, gravity: numpy.typing.ArrayLike | None = (0.0, 0.0, -9.80665), payload: Inertia | None = None) -> None:
        """
        Raises Error where an option is out of its range, and where Dynamics does.

        frequency: ω [rad/s] > 0 of the error's dynamics; the loop's rate should be 10 ω and more.
        damping_ratio: ζ > 0; 1 is critical.
        gravity: (3,) [m/s²] in base axes, as the controller knows it.
        payload: what the controller knows of the tip's load, in the tip's frame, as for Dynamics.
        """
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple[typing.Any, ...]) -> None:
        ...
    def update(self, q: numpy.typing.ArrayLike, qdot: numpy.typing.ArrayLike, q_desired: numpy.typing.ArrayLike, qdot_desired: numpy.typing.ArrayLike, qddot_desired: numpy.typing.ArrayLike) -> ComputedTorqueStep:
        """
        One cycle: the arm is at q, q̇ (n,), and should be at q_d, q̇_d, accelerating by q̈_d.
        """
    @property
    def dof(self) -> int:
        """
        Number of movable joints, n.
        """
    @property
    def options(self) -> dict[str, typing.Any]:
        """
        The options by keyword: with ** of them the constructor makes the same again.
        """

# ---- Least squares ----------------------------------------------------------------------------------------------------
class LeastSquaresSolution:
    """
    Answer of least_squares().
    """
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[int, bytes]:
        ...
    def __hash__(self) -> int:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple[typing.Any, ...]) -> None:
        ...
    @property
    def active(self) -> tuple[int, ...]:
        """
        Indices of the rows of G that hold the answer, or are violated.
        """
    @property
    def at_lower(self) -> tuple[int, ...]:
        """
        Indices of the unknowns held at their lower bound.
        """
    @property
    def at_upper(self) -> tuple[int, ...]:
        """
        Indices of the unknowns held at their upper bound.
        """
    @property
    def equality_error(self) -> float:
        """
        |C x − d|
        """
    @property
    def status(self) -> str:
        """
        'optimal'; 'infeasible': G x ≤ h or C x = d cannot be met, and is met as well as possible;
        'step limit': not converged.
        """
    @property
    def steps(self) -> int:
        """
        Factorisations taken.
        """
    @property
    def violation(self) -> float:
        """
        |max(0, G x − h)|
        """
    @property
    def x(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (n,) inside the bounds exactly
        """
def least_squares(A: numpy.typing.ArrayLike | None = None, b: numpy.typing.ArrayLike | None = None, *, C: numpy.typing.ArrayLike | None = None, d: numpy.typing.ArrayLike | None = None, lower: numpy.typing.ArrayLike | None = None, upper: numpy.typing.ArrayLike | None = None, G: numpy.typing.ArrayLike | None = None, h: numpy.typing.ArrayLike | None = None) -> LeastSquaresSolution:
    """
    min |A x − b|² where C x = d, lower ≤ x ≤ upper, G x ≤ h; of these the shortest x.

    A (m, n), b (m,), C (p, n), d (p,), lower, upper (n,), G (k, n), h (k,); n ≤ 24, m ≤ 32, p ≤ 8, k ≤ 32.
    Bounds and h may be infinite.

    There is always an answer: the bounds hold, then G x ≤ h as well as possible, then C x = d, then A x ≈ b.
    """

# ---- Constrained IK ---------------------------------------------------------------------------------------------------
class ConstrainedIkStep:
    """
    Answer of one cycle of a ConstrainedIk.
    """
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[int, bytes]:
        ...
    def __hash__(self) -> int:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple[typing.Any, ...]) -> None:
        ...
    @property
    def active(self) -> tuple[int, ...]:
        """
        Indices of the joints of which a limit is active.
        """
    @property
    def error(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (6,) [m, rad] tip minus target after the step, base axes
        """
    @property
    def error_active(self) -> bool:
        """
        max_error is active, or has been let go.
        """
    @property
    def exact_met(self) -> bool:
        """
        The exact part's equations hold.
        """
    @property
    def not_settling(self) -> bool:
        """
        The target has rested for longer than any motion takes (ConstrainedIk.settling_time), and the arm still moves.
        """
    @property
    def path_error(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (6,) [m, rad] the same, of the target slowed down by time_scale
        """
    @property
    def q(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (n,) position command [rad or m]
        """
    @property
    def qdot(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (n,) velocity command over the last dt [rad/s or m/s]
        """
    @property
    def status(self) -> Status:
        """
        OK: the target is met. DAMPED: not met, and no limit is to blame. LIMITED: a limit holds the step back.
        """
    @property
    def time_scale(self) -> float:
        """
        ϑ in [0, 1]: 0 as asked, 1 a complete stop; how hard the step is within the limits.
        """
    @property
    def torque_active(self) -> bool:
        """
        A torque limit is active, or cannot be met.
        """
    @property
    def used(self) -> str:
        """
        'analytic' or 'optimised'
        """
class ConstrainedIk:
    """
    Follows a target pose inside every joint limit: an exact part, and the rest as well as the
    limits allow (Schreiber, Otter and Hirzinger 1999).
    """
    __hash__: typing.ClassVar[None] = None  # type: ignore[assignment]
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[typing.Any, ...]:
        ...
    def __init__(self, chain: Chain, dt: typing.SupportsFloat | typing.SupportsIndex = 0.001, *, exact: numpy.typing.ArrayLike | None = (1, 1, 1, 0, 0, 0), alpha: numpy.typing.ArrayLike | None = 1.0, beta: numpy.typing.ArrayLike | None = 5.0, gamma: typing.SupportsFloat | typing.SupportsIndex | None = None, max_error: numpy.typing.ArrayLike | None = ..., iterations: typing.SupportsInt | typing.SupportsIndex = 2, torque_limits: bool = False, analytic: bool = True, mask: numpy.typing.ArrayLike | None = (1, 1, 1, 1, 1, 1), frame: typing.Literal['base', 'tool'] = 'base', gravity: numpy.typing.ArrayLike | None = (0.0, 0.0, -9.80665), position_limits: bool = True, velocity_limits: bool = True, acceleration_limits: bool = True, jerk_limits: bool = True, assumed_acceleration: typing.SupportsFloat | typing.SupportsIndex = 10.0, recovery_speed: typing.SupportsFloat | typing.SupportsIndex = 0.1, strict: bool = False) -> None:
        """
        Warns (ModelWarning) of velocity and acceleration limits that joints lack.

        dt: [s] > 0, from one update to the next.
        exact: (6,) truth values: the rows (vx, vy, vz, ωx, ωy, ωz) met exactly; the others as well as
            limits allow.
        alpha: ≥ 0, a number or (6,) [1/m, 1/rad]: weights of the error of the rows that are not exact.
        beta: ≥ 0, a number or (6,) [1/m, 1/rad]: weights of that error's change in a cycle. Free of limits
            an error decays by the factor β²/(α²+β²) a cycle (5 √(1 ms/dt) makes that 25 ms at any dt); with
            β = 0 the joints may oscillate.
        gamma: > 0, weight of the time scaling ϑ; None: the target is not slowed down.
        max_error: > 0, a number or (6,) [m, rad]: the largest error of the rows that are not exact, each
            for itself; let go where it cannot be had together with the exact part.
        iterations: 1 to 100 linearisations a cycle.
        torque_limits: whether the chain's effort limits are held, with its inertias; the closed form is not
            used then.
        analytic: whether the closed form is used where the chain has one and its answer is inside the
            limits.
        mask: (6,) truth values: the rows (vx, vy, vz, ωx, ωy, ωz) that matter; None: all.
        frame: the axes of these rows, the base's or the tool's.
        gravity: (3,) [m/s²] in base axes, for torque_limits.
        position_limits: whether the chain's position limits are held, now and so that they can be held for
            ever.
        velocity_limits: the same for its velocity limits.
        acceleration_limits: the same for its acceleration limits.
        jerk_limits: the same for its jerk limits.
        assumed_acceleration: [rad/s² or m/s²] > 0, the acceleration limit of joints whose model has none;
            inf: they have none.
        recovery_speed: in (0, 1], of the velocity limit: the least speed at which a joint that starts
            outside its position limits comes back.
        strict: whether `update` raises Error for a target that is no pose, in place of BAD_INPUT and a
            stop.
        """
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple[typing.Any, ...]) -> None:
        ...
    def reset(self, q: numpy.typing.ArrayLike, qdot: numpy.typing.ArrayLike | None = None) -> None:
        """
        Starts, or starts again, at q (n,), moving with qdot (n,).

        Warns (ModelWarning) of a joint that starts more than 1 rad or 1 m outside its limits.
        """
    def step(self, target: typing.Any) -> ConstrainedIkStep:
        """
        The same as update().
        """
    def update(self, target: typing.Any) -> ConstrainedIkStep:
        """
        One cycle towards a pose (4, 4) of the tip in the base. Raises Error where the target is no pose.
        """
    @property
    def chain(self) -> Chain:
        ...
    @property
    def dt(self) -> float:
        """
        [s]
        """
    @property
    def has_analytic(self) -> bool:
        """
        Whether the closed form is at hand.
        """
    @property
    def options(self) -> dict[str, typing.Any]:
        """
        The options by keyword: with ** of them the constructor makes the same again.
        """
    @property
    def pose(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (4, 4) tip in base at q.
        """
    @property
    def q(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (n,) where the reference stands.
        """
    @property
    def reference(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (4, 4) the pose that the last step aimed at: its target, slowed down by ϑ.
        """
    @property
    def settling_time(self) -> float:
        """
        [s], after which a motion towards a target that rests is faded out.
        """

# ---- Position IK ------------------------------------------------------------------------------------------------------
class PositionIkStatus(enum.IntEnum):
    """
    What a PositionIk found.
    """
    BAD_INPUT = ...
    OK = ...
    UNREACHABLE = ...
class PositionIkResult:
    """
    Answer of PositionIk.solve().
    """
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[int, bytes]:
        ...
    def __hash__(self) -> int:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple[typing.Any, ...]) -> None:
        ...
    @property
    def error(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (6,) [m, rad] pose_error from q to the target, base axes; zero in the rows that the task leaves out. With a
        cone, the orientation part is the rotation by which the axis misses its direction.
        """
    @property
    def q(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (n,) [rad or m] inside the limits. Where the pose is unreachable: the configuration found with the
        smallest |e_p/L|² + |e_o|², L = chain.characteristic_length.
        """
    @property
    def solve_time(self) -> float:
        """
        [s]
        """
    @property
    def status(self) -> PositionIkStatus:
        """
        See PositionIkStatus.
        """
class PositionIkBranch:
    """
    One of the solutions of PositionIk.branches().
    """
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[int, bytes]:
        ...
    def __hash__(self) -> int:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple[typing.Any, ...]) -> None:
        ...
    @property
    def margin(self) -> float:
        """
        [rad or m] from the nearest limit; inf where no joint has a limit.
        """
    @property
    def q(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (n,) [rad or m] inside the limits.
        """
    @property
    def sigma_min(self) -> float:
        """
        Least singular value of the task's rows, lengths in characteristic lengths.
        """
class PositionIk:
    """
    Joint positions of a pose, for any chain of 1 to 16 joints, inside its position limits.

        ik = sk.PositionIk(chain)
        r = ik.solve(pose)                           # or ik.solve(pose, near=q)
        r.q, r.status, r.error

    A Levenberg-Marquardt descent with an active set of limits, from the entries of a table of configurations whose
    poses are closest to the target. Six joints with a spherical wrist (AnalyticIk), or with three parallel axes as
    Universal Robots' arms have, are solved in closed form. The same call gives the same answer. Immutable, safe to
    share.
    """
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[typing.Any, ...]:
        ...
    def __hash__(self) -> int:
        ...
    def __init__(self, chain: Chain, tolerance: numpy.typing.ArrayLike = (1e-06, 1e-06), *, mask: numpy.typing.ArrayLike | None = (1, 1, 1, 1, 1, 1), frame: typing.Literal['base', 'tool'] = 'base', exact: numpy.typing.ArrayLike | None = (0, 0, 0, 0, 0, 0), ranges: numpy.typing.ArrayLike | None = None, cone: tuple[numpy.typing.ArrayLike, float] | None = None, starts: typing.SupportsInt | typing.SupportsIndex = 256) -> None:
        """
        tolerance: (2,) [m], [rad] > 0: the largest errors of position and orientation that a solution may
            have, beyond those that `ranges` and `cone` allow; most solutions are exact to rounding.
        mask: (6,) truth values: the rows (vx, vy, vz, ωx, ωy, ωz) that matter; None: all.
        frame: the axes of these rows, the base's or the tool's.
        exact: (6,) truth values: the rows that are held before the others. Of a pose that is unreachable,
            these are met where they can be, and the others are as near as possible.
        ranges: (6, 2) [m, rad]: the least and the largest error allowed in each row (target minus tip, as
            `error` has it), in the axes of `frame`; or (6,) ≥ 0, half the width of each range. Infinite is
            allowed. None: no error.
        cone: (axis, angle): an axis (3,) of the tool that may point anywhere within `angle` [rad] of its
            direction in the target pose, free to turn about itself; in place of the rows of the
            orientation.
        starts: 1 to 2048, the most starts of a search. A pose out of reach takes all of them.
        """
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple[typing.Any, ...]) -> None:
        ...
    def branches(self, pose: typing.Any) -> list[PositionIkBranch]:
        """
        The solutions of solve_all() in the same order, each with its least singular value and its margin.
        """
    def solve(self, pose: typing.Any, near: numpy.typing.ArrayLike | None = None) -> PositionIkResult:
        """
        A solution of `pose` (4, 4), tip in base; PositionIkResult.

        near: (n,) [rad or m]. The answer is then the nearest solution that a bounded search finds, in travel time
        max_i |q_i − near_i| / velocity limit_i (1 where there is no limit). Joints that may turn more than once are
        on the turn nearest to `near`, and a redundant arm is moved along its self-motion towards `near`.
        Without `near` it is the first solution that is found, or of a closed form the one farthest from the limits,
        each joint on the turn nearest to 0.

        Raises Error where `pose` is not a pose. A pose out of reach is UNREACHABLE, with the nearest pose found.
        """
    def solve_all(self, pose: typing.Any) -> numpy.typing.NDArray[numpy.float64]:
        """
        Distinct solutions (k, n) [rad or m] of `pose` (4, 4), those far from the limits first; k = 0 where none is
        found.

        Solutions that differ by whole turns, or by less than 0.01 rad, count once: each joint is on the turn nearest
        to the middle of its range. A redundant arm is moved along its self-motion to a local minimum of the
        distance to the middle of the ranges, and these minima are the representatives.
        """
    def solve_batch(self, poses: numpy.typing.ArrayLike, threads: typing.SupportsInt | typing.SupportsIndex = 1) -> numpy.typing.NDArray[numpy.float64]:
        """
        solve() of B poses (B, 4, 4), without the GIL: (B, n), a row of NaN where no solution is found.

        The answers do not depend on `threads`. Raises Error where an entry is not a pose.
        """
    @property
    def chain(self) -> Chain:
        """
        The arm.
        """
    @property
    def options(self) -> dict[str, typing.Any]:
        """
        The options by keyword: with ** of them the constructor makes the same again.
        """

# ---- Indices ----------------------------------------------------------------------------------------------------------
def evaluate_index(chain: Chain, q: numpy.typing.ArrayLike, index: str, k: numpy.typing.ArrayLike = 6.0, length_scale: typing.SupportsFloat | typing.SupportsIndex = 1.0, threads: typing.SupportsInt | typing.SupportsIndex = 1, gradients: bool = True) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
    """
    Values () or (B,) and, where asked for, gradients (n,) or (B, n) at q (n,) or (B, n).
    """
def index_of_jacobian(J: numpy.typing.ArrayLike, index: str, k: numpy.typing.ArrayLike = 6.0, length_scale: typing.SupportsFloat | typing.SupportsIndex = 1.0) -> float | numpy.typing.NDArray[numpy.float64]:
    """
    An index of J (m, n), or (B,) of J (B, m, n).
    """
def reference_scale(chain: Chain, length_scale: typing.SupportsFloat | typing.SupportsIndex = 1.0) -> float:
    """
    k of a chain: 6 where the largest eigenvalue of JJᵀ over its joint ranges stays below that by a tenth, else 1.1
    times that eigenvalue, so that the sphere kI holds every ellipsoid. The same on every machine; takes a few ms.
    """

# ---- Singularities ----------------------------------------------------------------------------------------------------
class SingularSets:
    """
    The known singular sets of an arm: potentials around them, and its manipulability in closed
    form (Beck et al. 2022, corrected and completed). q is (n,) in the chain's angles [rad], or
    (B, n): then every result has B rows.

    Set i is where ψ_i = Σ r² vanishes; its residuals r have no unit, and near the set ψ is about
    the squared distance in the joints' space. A set's codimension is the number of its residuals:
    those of codimension 1 are walls, across which r changes its sign.
    """
    def __eq__(self, arg0: typing.Any) -> bool:
        ...
    def __hash__(self) -> int:
        ...
    def __len__(self) -> int:
        ...
    def __reduce__(self) -> tuple[typing.Any, tuple[str]]:
        ...
    def __repr__(self) -> str:
        ...
    def _manipulability_tape(self) -> tuple[list[tuple[typing.Any, ...]], list[int]]:
        """
        See sigmaik.singularities.symbolic_manipulability_squared.
        """
    def _residual_tape(self) -> tuple[list[tuple[typing.Any, ...]], list[int]]:
        """
        See sigmaik.singularities.symbolic_residuals.
        """
    def gradient(self, q: numpy.typing.ArrayLike, eta1: typing.SupportsFloat | typing.SupportsIndex = 7.783224016336037, eta2: typing.SupportsFloat | typing.SupportsIndex = 400.0, weights: numpy.typing.ArrayLike | None = None) -> numpy.typing.NDArray[numpy.float64]:
        """
        Gradient (n,) of the potential [1/rad].
        """
    def hessian(self, q: numpy.typing.ArrayLike, eta1: typing.SupportsFloat | typing.SupportsIndex = 7.783224016336037, eta2: typing.SupportsFloat | typing.SupportsIndex = 400.0, weights: numpy.typing.ArrayLike | None = None) -> numpy.typing.NDArray[numpy.float64]:
        """
        Hessian (n, n) of the potential [1/rad²].
        """
    def manipulability(self, q: numpy.typing.ArrayLike) -> float | numpy.typing.NDArray[numpy.float64]:
        """
        √det(JJᵀ) in closed form, accurate down to zero.
        """
    def manipulability_gradient(self, q: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """
        Gradient (n,) of the manipulability; zero on a singular set, where there is none.
        """
    def manipulability_hessian(self, q: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """
        Hessian (n, n) of the manipulability; zero on a singular set, where there is none.
        """
    def potential(self, q: numpy.typing.ArrayLike, eta1: typing.SupportsFloat | typing.SupportsIndex = 7.783224016336037, eta2: typing.SupportsFloat | typing.SupportsIndex = 400.0, weights: numpy.typing.ArrayLike | None = None) -> float | numpy.typing.NDArray[numpy.float64]:
        """
        Σ_i w_i exp(η₁ − η₂ ψ_i(q)); w (c,), by default ones.
        """
    def residuals(self, q: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """
        ψ (c,) ≥ 0 of every set, zero exactly on it.
        """
    def signed_residuals(self, q: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """
        The residuals themselves, set after set: codimensions[i] numbers for set i.
        """
    @property
    def codimensions(self) -> tuple[int, ...]:
        """
        Number of residuals of each set.
        """
    @property
    def conditions(self) -> tuple[str, ...]:
        """
        What holds on each set, in words.
        """
    @property
    def dof(self) -> int:
        """
        Number of joints, n.
        """
    @property
    def joints(self) -> tuple[tuple[int, ...], ...]:
        """
        Indices of the joints in each condition.
        """
    @property
    def name(self) -> str:
        """
        Of the arm.
        """
    @property
    def names(self) -> tuple[str, ...]:
        """
        Of the sets, c of them.
        """
def known_singular_sets() -> tuple[str, ...]:
    ...
def load_singular_sets(name: str) -> SingularSets:
    ...
def singular_sets_of(chain: Chain) -> SingularSets | None:
    ...

# ---- Trajectory -------------------------------------------------------------------------------------------------------
class Crossing:
    """
    A motion goes through a singular set here, or so near to it that the set's potential does not
    tell the difference.
    """
    __hash__: typing.ClassVar[None] = None  # type: ignore[assignment]
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[str, float, list[float], float, bool]:
        ...
    def __init__(self, name: str, t: typing.SupportsFloat | typing.SupportsIndex, q: numpy.typing.ArrayLike, psi: typing.SupportsFloat | typing.SupportsIndex, avoidable: bool) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple[typing.Any, ...]) -> None:
        ...
    @property
    def avoidable(self) -> bool:
        """
        Whether a path from start to goal can do without.
        """
    @property
    def name(self) -> str:
        """
        Name of the set.
        """
    @property
    def psi(self) -> float:
        """
        ψ there: 0 on the set.
        """
    @property
    def q(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (n,) [rad or m] there.
        """
    @property
    def t(self) -> float:
        """
        [s]
        """
class Clearance:
    """
    Singularity along a motion that is sampled densely, M samples.
    """
    __hash__: typing.ClassVar[None] = None  # type: ignore[assignment]
    def __eq__(self, arg0: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[list[float], list[float], list[str], list[float], list[Crossing]]:
        ...
    def __init__(self, t: numpy.typing.ArrayLike, manipulability: numpy.typing.ArrayLike, names: collections.abc.Sequence[str], psi: numpy.typing.ArrayLike, crossings: collections.abc.Sequence[Crossing]) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple[typing.Any, ...]) -> None:
        ...
    @property
    def avoidable(self) -> tuple[Crossing, ...]:
        """
        Crossings that a path from start to goal can do without.
        """
    @property
    def crossings(self) -> tuple[Crossing, ...]:
        """
        In the order of time.
        """
    @property
    def manipulability(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (M,) √det(JJᵀ)
        """
    @property
    def min_manipulability(self) -> float:
        """
        The smallest √det(JJᵀ) of all samples.
        """
    @property
    def min_psi(self) -> float:
        """
        The smallest ψ of all sets and samples; inf where no sets are known.
        """
    @property
    def names(self) -> tuple[str, ...]:
        """
        Names of the singular sets that are known; empty where none are.
        """
    @property
    def nearest_set(self) -> str | None:
        """
        The set with the smallest ψ; None where no sets are known.
        """
    @property
    def psi(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (M, c) ψ of every set: 0 on it.
        """
    @property
    def t(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (M,) [s]
        """
    @property
    def unavoidable(self) -> tuple[Crossing, ...]:
        """
        The other crossings.
        """
class Trajectory:
    """
    Joint positions over time, N samples of n joints, and how they were found.

    Between samples the acceleration is constant, or, where `cubic`, changes evenly: `sample` is
    exact. A failed plan has no samples: its arrays are empty.
    """
    __hash__: typing.ClassVar[None] = None  # type: ignore[assignment]
    @staticmethod
    def _load_text(file: str) -> Trajectory:
        ...
    @staticmethod
    def load(file: str | os.PathLike[str]) -> Trajectory:
        """
        What `save` has written. Raises Error where the file is something else.
        """
    def __eq__(self, arg0: typing.Any) -> bool:
        ...
    def __getstate__(self) -> tuple[int, list[float], list[float], list[float], list[float], float, str, float, float, int, int, bool, Clearance | None]:
        ...
    @typing.overload
    def __init__(self, t: numpy.typing.ArrayLike, q: numpy.typing.ArrayLike, qdot: numpy.typing.ArrayLike, qddot: numpy.typing.ArrayLike, duration: typing.SupportsFloat | typing.SupportsIndex, status: str, cost: typing.SupportsFloat | typing.SupportsIndex, solve_time: typing.SupportsFloat | typing.SupportsIndex, iterations: typing.SupportsInt | typing.SupportsIndex = 0, starts: typing.SupportsInt | typing.SupportsIndex = 1, cubic: bool = False, clearance: Clearance | None = None) -> None:
        ...
    @typing.overload
    def __init__(self, other: Trajectory) -> None:
        """
        A copy.
        """
    def __len__(self) -> int:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple[typing.Any, ...]) -> None:
        ...
    def _save_text(self, file: str) -> None:
        ...
    def plot(self, file: str | os.PathLike[str], chain: Chain | None = None) -> pathlib.Path:
        """
        Writes a picture, `planning.figure.trajectory_figure`, as PNG, whole or not at all. Returns its path.

        Raises Error where there is nothing to draw, the chain has other joints, or the file's name does not end in
        .png, and MissingPackage where matplotlib is not installed.
        """
    def retimed(self, duration: typing.SupportsFloat | typing.SupportsIndex) -> Trajectory:
        """
        The same path in another duration [s], faster or slower everywhere by the same factor.
        """
    def sample(self, t: numpy.typing.ArrayLike) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
        """
        q, q̇, q̈ (M, n) at times t (M,) [s], held at the ends. Raises Error where there is nothing to sample.
        """
    def save(self, file: str | os.PathLike[str]) -> pathlib.Path:
        """
        Writes a file, whole or not at all, and returns its path. A name that ends in .csv gives the text that C++
        reads too (planning/trajectory.hpp), without the clearance; any other name an npz file that numpy.load reads
        without pickles.
        """
    @property
    def clearance(self) -> Clearance:
        """
        How near to singularities the motion comes, between the samples too; None where the plan failed.
        """
    @property
    def cost(self) -> float:
        """
        The planner's objective; nan where the plan failed.
        """
    @property
    def cubic(self) -> bool:
        """
        Whether positions are cubic between samples, as under a Gaussian-process prior, or quadratic.
        """
    @property
    def duration(self) -> float:
        """
        [s]; nan where the plan failed. See the planner for what it counts.
        """
    @property
    def iterations(self) -> int:
        """
        Steps of the optimiser, of all starts.
        """
    @property
    def q(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (N, n) [rad or m]
        """
    @property
    def qddot(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (N, n) [rad/s² or m/s²], of the step that begins at the sample, zero in the last row;
        where `cubic`, at the sample.
        """
    @property
    def qdot(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (N, n) [rad/s or m/s]
        """
    @property
    def solve_time(self) -> float:
        """
        [s] of wall-clock time, of the optimiser alone.
        """
    @property
    def starts(self) -> int:
        """
        First guesses tried.
        """
    @property
    def status(self) -> sigmaik.planning.status.PlanStatus:
        """
        'optimal', a local minimum; 'feasible', within all constraints, but with something left to gain; 'failed'.
        """
    @property
    def t(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (N,) [s]
        """
class Playback:
    """
    What a servo made of a planned motion: M samples, one at the begin of each cycle, and one at the
    last cycle's end.
    """
    def __repr__(self) -> str:
        ...
    @property
    def joint_difference(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (M, n) planned minus the servo's [rad or m]: poses do not say where a redundant arm's elbow is.
        """
    @property
    def max_joint_difference(self) -> float:
        """
        The largest |planned minus the servo's| of all joints [rad or m].
        """
    @property
    def max_orientation_error(self) -> float:
        """
        The largest angle between the tip and its plan [rad].
        """
    @property
    def max_position_error(self) -> float:
        """
        The tip's largest distance from its plan [m].
        """
    @property
    def planned(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (M, n) the trajectory's positions [rad or m].
        """
    @property
    def pose_error(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (M, 6) planned pose minus the servo's, [position; rotation vector], base axes [m, rad].
        """
    @property
    def q(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (M, n) the servo's positions [rad or m].
        """
    @property
    def qdot(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (M, n) command of the cycle that begins at the sample [rad/s or m/s]; the last row
        repeats the one before.
        """
    @property
    def status(self) -> tuple[Status, ...]:
        """
        M − 1, one for each cycle.
        """
    @property
    def t(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (M,) [s] times of the trajectory, and those for which its end is held.
        """
def clearance(chain: Chain, sets: SingularSets | None, t: numpy.typing.ArrayLike, q: numpy.typing.ArrayLike, *, width: typing.SupportsFloat | typing.SupportsIndex = 400.0) -> Clearance:
    """
    Clearance of the configurations q (M, n) at increasing times t (M,) [s].

    sets: the arm's singular sets, or None.
    width: η₂ [1/rad²]: sets of codimension above 1 count as crossed where ψ < 1/(2 width) between ends that are
        both outside.
    """
def nearest_turn(chain: Chain, start: numpy.typing.ArrayLike, goal: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
    """
    The goal (n,) with each continuous joint on the turn nearest to the start, at most π away.
    """
def play(trajectory: Trajectory, servo: Servo, *, settle: typing.SupportsFloat | typing.SupportsIndex = 0.5) -> Playback:
    """
    Plays a planned motion through a servo that stands at its start, as poses with feed-forward twists, at the
    servo's dt.

    In the cycle from t to t + dt the target is the pose planned for t, and the feed-forward twist is J(q) q̇ of
    the plan in the middle of the cycle. A cycle of constant q̇ leaves the error ½ dt² J̇ q̇, and the gains keep
    the sum of these errors to ½ dt |J̇ q̇| / gain: micrometres at 1 kHz. The soft start costs more. The servo
    holds its limits and treats singularities by its own rule, so it may leave the plan; its gains bring it back.
    The servo's history goes on: call `servo.reset` before.

    settle: [s] for which the last pose is held.

    Raises Error where the trajectory is empty or has other joints, the servo stands elsewhere (1e-6 rad or m), or
    settle is not finite or negative.
    """

# ---- Joint cost -------------------------------------------------------------------------------------------------------
class JointCost:
    """
    A smooth cost of joint positions, with its derivatives.
    """
    def gradients(self, q: numpy.typing.ArrayLike, threads: typing.SupportsInt | typing.SupportsIndex = 1) -> numpy.typing.NDArray[numpy.float64]:
        """
        Gradients (B, n) at q (B, n), without the GIL.
        """
    def model(self, q: numpy.typing.ArrayLike) -> tuple[float, numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
        """
        Cost, gradient (n,) and Hessian (n, n) at q (n,).
        """
    def value(self, q: numpy.typing.ArrayLike) -> float:
        """
        Cost at q (n,).
        """
    def values(self, q: numpy.typing.ArrayLike, threads: typing.SupportsInt | typing.SupportsIndex = 1) -> numpy.typing.NDArray[numpy.float64]:
        """
        Costs (B,) at q (B, n), without the GIL.
        """
    @property
    def dof(self) -> int:
        """
        Number of joints, n.
        """
def geometry_aware_cost(chain: Chain, k: typing.SupportsFloat | typing.SupportsIndex, weight: typing.SupportsFloat | typing.SupportsIndex) -> JointCost:
    """
    weight · ξ(q), the geometry-aware index, cut off at 2000.
    """
def log_manipulability_cost(chain: Chain, weight: typing.SupportsFloat | typing.SupportsIndex) -> JointCost:
    """
    −weight · log m(q), m no less than 1e-9.
    """
@typing.overload
def manipulability_cost(sets: SingularSets, weight: typing.SupportsFloat | typing.SupportsIndex, epsilon: typing.SupportsFloat | typing.SupportsIndex) -> JointCost:
    """
    weight/(m(q) + ε), m in closed form.
    """
@typing.overload
def manipulability_cost(chain: Chain, weight: typing.SupportsFloat | typing.SupportsIndex, epsilon: typing.SupportsFloat | typing.SupportsIndex) -> JointCost:
    """
    weight/(m(q) + ε), m from the Jacobian.
    """
def potential_cost(sets: SingularSets, weight: typing.SupportsFloat | typing.SupportsIndex, eta1: typing.SupportsFloat | typing.SupportsIndex, eta2: typing.SupportsFloat | typing.SupportsIndex) -> JointCost:
    """
    weight · Σ_i exp(η₁ − η₂ ψ_i(q)).
    """
def scaled_cost(factor: typing.SupportsFloat | typing.SupportsIndex, cost: JointCost) -> JointCost:
    """
    factor · cost.
    """
def sum_of_costs(costs: collections.abc.Sequence[JointCost]) -> JointCost:
    """
    Σ of costs for the same joints.
    """

# ---- Obstacles --------------------------------------------------------------------------------------------------------
class DistanceField:
    """
    Signed distances [m] to obstacles on a regular grid, interpolated trilinearly: positive in
    free space, negative inside. Outside the grid: continuous, growing, and no more than the
    distance to what lies within.
    """
    def __init__(self, distances: numpy.typing.ArrayLike, origin: numpy.typing.ArrayLike, cell: typing.SupportsFloat | typing.SupportsIndex) -> None:
        """
        distances (X, Y, Z) [m] at the nodes, the first of which is at `origin` (3,) [m] in the axes of the arm's base;
        `cell` [m] from node to node.
        """
    def __repr__(self) -> str:
        ...
    def distance(self, points: numpy.typing.ArrayLike) -> float | numpy.typing.NDArray[numpy.float64]:
        """
        [m] at a point (3,), or (M,) at points (M, 3).
        """
    def gradient(self, points: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """
        Gradient (3,) of the distance at a point (3,), or (M, 3) at points (M, 3).
        """
    @property
    def cell(self) -> float:
        """
        [m]
        """
    @property
    def origin(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (3,) [m] of the first node.
        """
    @property
    def shape(self) -> tuple[int, int, int]:
        """
        Nodes along each axis.
        """
class ArmSpheres:
    """
    An arm as S spheres fixed to its links, in the order in which joints move them, base to tip.

    `sigmaik.planning.arm_spheres` makes them from a URDF, or along the links.
    """
    @staticmethod
    def along_links(chain: Chain, radius: typing.SupportsFloat | typing.SupportsIndex = 0.05) -> ArmSpheres:
        """
        Capsules from each link's frame to the next.
        """
    @staticmethod
    def from_urdf(chain: Chain, source: typing.Any, radius: typing.SupportsFloat | typing.SupportsIndex = 0.05) -> ArmSpheres:
        """
        Covers the boxes, cylinders and spheres of a URDF; links with meshes as along_links does.
        """
    def __init__(self, chain: Chain, links: collections.abc.Sequence[str], centers: numpy.typing.ArrayLike, radii: numpy.typing.ArrayLike) -> None:
        """
        links: the name of each sphere's link; centers (S, 3) [m] in the link's frame; radii (S,) [m].
        """
    def __len__(self) -> int:
        ...
    def __repr__(self) -> str:
        ...
    def centers(self, q: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """
        (S, 3) [m] in the base's axes at q (n,); (B, S, 3) at q (B, n).
        """
    def jacobians(self, q: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """
        ∂center/∂q (S, 3, n) at q (n,); (B, S, 3, n) at q (B, n).
        """
    @property
    def chain(self) -> Chain:
        """
        The arm.
        """
    @property
    def first_moving(self) -> int:
        """
        The first sphere that a joint moves; those before it belong to the base.
        """
    @property
    def links(self) -> tuple[str, ...]:
        """
        The name of each sphere's link.
        """
    @property
    def local_centers(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (S, 3) [m] in the link's frame.
        """
    @property
    def radii(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (S,) [m]
        """
def collision_cost(spheres: ArmSpheres, field: DistanceField, clearance: typing.SupportsFloat | typing.SupportsIndex = 0.05, weight: typing.SupportsFloat | typing.SupportsIndex = 1.0) -> JointCost:
    """
    weight · Σ c(d) over the spheres that move, d the signed distance of their surfaces to the obstacles.
    """
def joint_limit_cost(chain: Chain, margin: typing.SupportsFloat | typing.SupportsIndex = 0.1, weight: typing.SupportsFloat | typing.SupportsIndex = 1.0) -> JointCost:
    """
    weight · Σ ½x², x the way by which a joint is nearer to a limit than `margin` [rad or m], or beyond it.
    """
def min_distance(spheres: ArmSpheres, field: DistanceField, q: numpy.typing.ArrayLike, threads: typing.SupportsInt | typing.SupportsIndex = 1) -> float | numpy.typing.NDArray[numpy.float64]:
    """
    The least signed distance [m] from a sphere that moves to the obstacles at q (n,), or (B,) at q (B, n).
    """
def self_collision_cost(spheres: ArmSpheres, pairs: numpy.typing.ArrayLike | None = None, clearance: typing.SupportsFloat | typing.SupportsIndex = 0.02, weight: typing.SupportsFloat | typing.SupportsIndex = 1.0) -> JointCost:
    """
    weight · Σ c(d) over pairs of spheres (P, 2), by default `self_collision_pairs(spheres, clearance)`;
    d the distance of their surfaces, c(d) as in `collision_cost`.
    """
def self_collision_pairs(spheres: ArmSpheres, clearance: typing.SupportsFloat | typing.SupportsIndex = 0.02, most_contacts: typing.SupportsFloat | typing.SupportsIndex = 0.1) -> numpy.typing.NDArray[numpy.int32]:
    """
    (P, 2) spheres of links that are not neighbours, but for those nearer than `clearance` [m] at more than a share
    `most_contacts` (0 … 1) of a thousand configurations within the joint limits. The same on every machine; takes some
    ms.
    """

# ---- Support states ---------------------------------------------------------------------------------------------------
def draw_from_prior(chain: Chain, cost: JointCost, states: typing.SupportsInt | typing.SupportsIndex, start: numpy.typing.ArrayLike, goal: numpy.typing.ArrayLike, *, deviation: typing.SupportsFloat | typing.SupportsIndex, seed: typing.SupportsInt | typing.SupportsIndex) -> numpy.typing.NDArray[numpy.float64]:
    """
    q (states, n) of a motion from the prior about the straight line: a first guess of the planner with this cost.
    """
def plan_gradient(chain: Chain, start: numpy.typing.ArrayLike, goal: numpy.typing.ArrayLike, python_costs: collections.abc.Sequence[typing.Any], cost: JointCost | None = None, spheres: ArmSpheres | None = None, field: DistanceField | None = None, *, states: typing.SupportsInt | typing.SupportsIndex = 21, prior_weight: typing.SupportsFloat | typing.SupportsIndex = 10.0, max_iterations: typing.SupportsInt | typing.SupportsIndex = 100, tolerance: typing.SupportsFloat | typing.SupportsIndex = 0.0001, restarts: typing.SupportsInt | typing.SupportsIndex = 8, duration: typing.SupportsFloat | typing.SupportsIndex | None = None, whole_turns: bool = False) -> Trajectory:
    """
    `sigmaik.planning.gradient` is what to call.

    python_costs: added up to `cost`, each with value(q: (B, n)) -> (B,), and a gradient or not.
    states: N + 1, 3 to 1000 support states, ends included.
    prior_weight: > 0, of ‖q − μ‖² against the cost.
    max_iterations: ≥ 1.
    tolerance: ≥ 0: the search stops where an iteration gains less than this part of the objective.
    restarts: ≥ 0. Where the motion found from the straight line touches an obstacle, so many other
        motions are found from first guesses drawn from the prior, the same each time, with a standard
        deviation of 0.5 rad or m half-way. The motion of least cost that touches no obstacle is the
        answer.
    duration: [s] > 0. None: the shortest that keeps the limits of velocity and acceleration, 1 s where
        there are none.
    whole_turns: whether goals count whole turns. False: continuous joints take the shorter way, of at
        most half a turn.
    """
def plan_stochastic(chain: Chain, start: numpy.typing.ArrayLike, goal: numpy.typing.ArrayLike, python_costs: collections.abc.Sequence[typing.Any], cost: JointCost | None = None, spheres: ArmSpheres | None = None, field: DistanceField | None = None, seed: typing.SupportsInt | typing.SupportsIndex | None = None, *, states: typing.SupportsInt | typing.SupportsIndex = 21, samples: typing.SupportsInt | typing.SupportsIndex = 10, max_iterations: typing.SupportsInt | typing.SupportsIndex = 30, deviation: typing.SupportsFloat | typing.SupportsIndex = 0.5, decay: typing.SupportsFloat | typing.SupportsIndex = 0.98, temperature: typing.SupportsFloat | typing.SupportsIndex = 0.1, prior_weight: typing.SupportsFloat | typing.SupportsIndex = 10.0, tolerance: typing.SupportsFloat | typing.SupportsIndex = 0.001, refine: bool = False, duration: typing.SupportsFloat | typing.SupportsIndex | None = None, whole_turns: bool = False) -> Trajectory:
    """
    `sigmaik.planning.stochastic` is what to call.

    python_costs: added up to `cost`, each with value(q: (B, n)) -> (B,), and a gradient or not.
    states: N + 1, 3 to 1000 support states, ends included.
    samples: ≥ 2, motions drawn in an iteration.
    max_iterations: ≥ 1.
    deviation: [rad or m] > 0, standard deviation of the samples half-way.
    decay: in (0, 1], of the deviation from one iteration to the next.
    temperature: > 0: a sample weighs exp(−(G − G_min)/(temperature (G_max − G_min))).
    prior_weight: ≥ 0, of ‖q − μ‖² against the cost.
    tolerance: ≥ 0: the search stops where eight iterations together gain less than this part of the
        objective.
    refine: whether `gradient` finishes the motion that the samples found.
    duration: [s] as for `gradient`.
    whole_turns: whether goals count whole turns. False: continuous joints take the shorter way, of at
        most half a turn.
    """
def spline_velocities(q: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
    """
    Velocities (states, n) of the natural cubic spline through q (states, n), in unit time.
    """

# ---- Time optimal -----------------------------------------------------------------------------------------------------
class TimeOptimalResult:
    """
    Answer of TimeOptimal.solve().
    """
    def nodes(self, dof: typing.SupportsInt | typing.SupportsIndex) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
        """
        q, q̇, q̈ (N, n), or (0, n) where failed.
        """
    @property
    def cost(self) -> float:
        """
        The objective.
        """
    @property
    def duration(self) -> float:
        """
        [s] t_F = N h.
        """
    @property
    def gap(self) -> float:
        """
        Estimate of what is left to gain.
        """
    @property
    def iterations(self) -> int:
        """
        Newton steps, of all starts.
        """
    @property
    def starts(self) -> int:
        """
        First guesses tried.
        """
    @property
    def status(self) -> str:
        """
        'optimal', 'feasible' (within all constraints, but there is something to gain) or 'failed'.
        """
class TimeOptimal:
    """
    Time-optimal motions of one arm with one cost, after Beck et al. (2022), by an interior-point
    method made for double integrators. `sigmaik.planning.time_optimal` is what to call.
    """
    def __init__(self, chain: Chain, cost: JointCost | None = None, sets: SingularSets | None = None, spheres: ArmSpheres | None = None, field: DistanceField | None = None, *, nodes: typing.SupportsInt | typing.SupportsIndex = 30, time_weight: typing.SupportsFloat | typing.SupportsIndex = 1.0, effort_weight: typing.SupportsFloat | typing.SupportsIndex = 1.0, tolerance: typing.SupportsFloat | typing.SupportsIndex = 1e-09, max_iterations: typing.SupportsInt | typing.SupportsIndex = 500, between_nodes: bool = True, restarts: bool = True, clearance_width: typing.SupportsFloat | typing.SupportsIndex = 400.0, whole_turns: bool = False) -> None:
        """
        Raises Error where an option is out of its range.

        nodes: N, 5 to 10 000.
        time_weight: [1/s] > 0.
        effort_weight: [s⁴/rad²] ≥ 0, and > 0 where a joint has no acceleration limit.
        tolerance: in [1e-12, 1e-2], what is left to gain, as a part of the objective between the ends.
        max_iterations: ≥ 1, Newton steps of a start.
        between_nodes: whether the motion keeps the position limits between the nodes too, where a parabola
            can overshoot. False: at the nodes alone, as in the paper.
        restarts: whether the planner also searches on the other sides, where the motion found still leads
            through what the cost marks.
        clearance_width: [1/rad²] > 0: sets of codimension above 1 count as crossed where ψ < 1/(2
            clearance_width). Where a call has eta2, its default is eta2.
        whole_turns: whether goals count whole turns. False: continuous joints take the shorter way, of at
            most half a turn.
        """
    def plan(self, start: numpy.typing.ArrayLike, goal: numpy.typing.ArrayLike, start_velocity: numpy.typing.ArrayLike | None = None, goal_velocity: numpy.typing.ArrayLike | None = None) -> Trajectory:
        """
        A motion with its clearance, and, where it crosses a singular set that it need not, the better of it and of
        one from the other side.
        """
    def solve(self, start: numpy.typing.ArrayLike, goal: numpy.typing.ArrayLike, start_velocity: numpy.typing.ArrayLike | None = None, goal_velocity: numpy.typing.ArrayLike | None = None, bend: numpy.typing.ArrayLike | None = None) -> TimeOptimalResult:
        """
        A motion between (n,) positions and velocities; `bend` (n,) is added to the first guess half-way.

        Raises Error where an end is outside its limits. One call at a time for each object.
        """

# ---- Cart -------------------------------------------------------------------------------------------------------------
class CartError(Error):
    """
    No cart motion keeps out of the forbidden region. The text carries the facts.
    """
    feasible_radius: typing.ClassVar[float]
    reason: typing.ClassVar[str] = ''
class CartRegion:
    """
    A connected part of the forbidden region, in the plane of time and cart position.
    """
    @property
    def first(self) -> float:
        """
        [samples] where it begins: its tip, between samples.
        """
    @property
    def last(self) -> float:
        """
        [samples] where it ends.
        """
    @property
    def side(self) -> int:
        """
        1: the law passes above λ+; −1: below λ−.
        """
class CartMeasures:
    """
    What motions of a cart with one axis and with two have in common: M samples, evenly spaced
    in time.
    """
    @property
    def admissible(self) -> bool:
        """
        No sample is within the radius.
        """
    @property
    def clearance(self) -> float:
        """
        [m] the point's least distance from the first joint's axis, between the samples too.
        """
    @property
    def duration(self) -> float:
        """
        [s] from the first to the last sample.
        """
    @property
    def energy(self) -> float:
        """
        [m²] Σ |Δ|² of the cart; with a corner between samples, of the steps that it makes, each over its
        part of a sample.
        """
    @property
    def flange_xy(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (M, 2) [m] the path that was given.
        """
    @property
    def inside(self) -> int:
        """
        Samples within the radius.
        """
    @property
    def margin(self) -> float:
        """
        [m] that was added to the radius in planning.
        """
    @property
    def radius(self) -> float:
        """
        [m] of the forbidden cylinder, without the margin.
        """
    @property
    def t(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (M,) [s] of the samples.
        """
    @property
    def time_inside(self) -> float:
        """
        [s] of the samples within the radius.
        """
    @property
    def turn(self) -> float:
        """
        [rad] by which the point's azimuth turns, seen from the axis: which way round, and how often.
        """
class CartMotion(CartMeasures):
    """
    Where the cart is at each of M samples evenly spaced in time, and what it had to keep out of. Straight between
    samples, but where `corners` has one between two of them: at the tip of a forbidden region.
    """
    def __repr__(self) -> str:
        ...
    def sample(self, t: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """
        x (…) [m] at times t (…) [s], held at the ends.
        """
    @property
    def corner_x(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (K,) [m] there.
        """
    @property
    def corners(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (K,) [samples] where the law bends, and its ends.
        """
    @property
    def iterations(self) -> int:
        """
        Steps of the gradient descent, or taut strings drawn.
        """
    @property
    def lower(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (M,) [m] λ−: between it and `upper` the cart is not allowed, at radius + margin; inf where it is free.
        """
    @property
    def max_acceleration(self) -> float:
        """
        [m/s²], the largest second difference over the samples.
        """
    @property
    def max_speed(self) -> float:
        """
        [m/s]
        """
    @property
    def method(self) -> str:
        """
        'exact' or 'gradient'; 'given' for a law that was only looked at.
        """
    @property
    def multipliers(self) -> numpy.typing.NDArray[numpy.float64] | None:
        """
        (M,) [m] μ_i = 2x_i − x_{i−1} − x_{i+1} of the exact law: > 0 only where it is held up by λ+ or the cart's
        range, < 0 only where it is held down, 0 elsewhere (not where the acceleration is limited); else None.
        """
    @property
    def regions(self) -> tuple[CartRegion, ...]:
        """
        Connected parts of the forbidden region, with their sides; empty where `method` is not 'exact'.
        """
    @property
    def sides(self) -> numpy.typing.NDArray[numpy.int8]:
        """
        (M,) 1 where the cart is above a forbidden interval, −1 below, 0 where there is none, or it is inside.
        """
    @property
    def upper(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (M,) [m] λ+; −inf where the cart is free.
        """
    @property
    def x(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (M,) [m] of the cart.
        """
class PlaneCartMotion(CartMeasures):
    """
    Where a cart with two axes is at each of M samples evenly spaced in time, straight between them.
    """
    def __repr__(self) -> str:
        ...
    def sample(self, t: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """
        xy (…, 2) [m] at times t (…) [s], held at the ends.
        """
    @property
    def farthest(self) -> float:
        """
        [m] the point's largest distance from the axis.
        """
    @property
    def max_acceleration(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (2,) [m/s²] of each axis, the largest second differences over the samples.
        """
    @property
    def max_speed(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (2,) [m/s] of each axis.
        """
    @property
    def programs(self) -> int:
        """
        Quadratic programs solved.
        """
    @property
    def push(self) -> numpy.typing.NDArray[numpy.float64] | None:
        """
        (M,) [m] ≥ 0, |2c_i − c_{i−1} − c_{i+1}| where the cart c touches the disc about the point, away from it,
        else 0. At an optimum without limits the cart bends nowhere else. None for a motion that was only looked at.
        """
    @property
    def starts(self) -> int:
        """
        First guesses tried.
        """
    @property
    def xy(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (M, 2) [m] of the cart.
        """
def admissible_guess(flange_xy: numpy.typing.ArrayLike, start: typing.SupportsFloat | typing.SupportsIndex, end: typing.SupportsFloat | typing.SupportsIndex, radius: typing.SupportsFloat | typing.SupportsIndex, lower: typing.SupportsFloat | typing.SupportsIndex, upper: typing.SupportsFloat | typing.SupportsIndex, *, turn: typing.SupportsFloat | typing.SupportsIndex | None = None, margin: typing.SupportsFloat | typing.SupportsIndex = 0.0, duration: typing.SupportsFloat | typing.SupportsIndex = 1.0, max_speed: typing.SupportsFloat | typing.SupportsIndex = ..., max_acceleration: typing.SupportsFloat | typing.SupportsIndex = ..., at_rest: bool = False) -> numpy.typing.NDArray[numpy.float64]:
    """
    A first guess (M,) of the descent that jumps past the forbidden region, on the sides of the exact law.

    lower: [m] of the cart's range.
    upper: [m] of the cart's range.
    turn: [rad] that joint 1 turns through from the first to the last sample. Laws that turn the point's
        azimuth by another number of whole turns are left out: they would bring the arm to its last
        pose, but not to its taught joints. None: the winding is not checked.
    margin: [m] ≥ 0, added to the radius in planning. Between samples the law can be nearer than radius
        + margin by max|Δ²λ|/8.
    duration: [s] > 0 from the first to the last sample. The limits count in it.
    max_speed: [m/s] > 0 of the cart. A law within the speed limit is found if there is one.
    max_acceleration: [m/s²] > 0 of the cart, second differences over the samples. Where the law of the
        least energy accelerates too much, the law of the least energy that does not takes its place, on
        the same sides, by an interior-point method; other sides are not tried.
    at_rest: whether the cart starts and stops within max_acceleration, where max_acceleration is
        finite.
    """
def cart_descent(lower: numpy.typing.ArrayLike, upper: numpy.typing.ArrayLike, guess: numpy.typing.ArrayLike, alpha: typing.SupportsFloat | typing.SupportsIndex, step: typing.SupportsFloat | typing.SupportsIndex, max_iterations: typing.SupportsInt | typing.SupportsIndex, until_admissible: bool) -> tuple[numpy.typing.NDArray[numpy.float64], int]:
    """
    Gradient descent (10) from a guess (M,) [m]: the law and the number of iterations.
    """
def cart_motion(flange_xy: numpy.typing.ArrayLike, start: typing.SupportsFloat | typing.SupportsIndex, end: typing.SupportsFloat | typing.SupportsIndex, radius: typing.SupportsFloat | typing.SupportsIndex, lower: typing.SupportsFloat | typing.SupportsIndex, upper: typing.SupportsFloat | typing.SupportsIndex, *, turn: typing.SupportsFloat | typing.SupportsIndex | None = None, margin: typing.SupportsFloat | typing.SupportsIndex = 0.0, duration: typing.SupportsFloat | typing.SupportsIndex = 1.0, max_speed: typing.SupportsFloat | typing.SupportsIndex = ..., max_acceleration: typing.SupportsFloat | typing.SupportsIndex = ..., at_rest: bool = False) -> CartMotion:
    """
    The exact law. `sigmaik.planning.cart_motion` is what to call.

    lower: [m] of the cart's range.
    upper: [m] of the cart's range.
    turn: [rad] that joint 1 turns through from the first to the last sample. Laws that turn the point's
        azimuth by another number of whole turns are left out: they would bring the arm to its last
        pose, but not to its taught joints. None: the winding is not checked.
    margin: [m] ≥ 0, added to the radius in planning. Between samples the law can be nearer than radius
        + margin by max|Δ²λ|/8.
    duration: [s] > 0 from the first to the last sample. The limits count in it.
    max_speed: [m/s] > 0 of the cart. A law within the speed limit is found if there is one.
    max_acceleration: [m/s²] > 0 of the cart, second differences over the samples. Where the law of the
        least energy accelerates too much, the law of the least energy that does not takes its place, on
        the same sides, by an interior-point method; other sides are not tried.
    at_rest: whether the cart starts and stops within max_acceleration, where max_acceleration is
        finite.
    """
def cart_motion_by_descent(flange_xy: numpy.typing.ArrayLike, start: typing.SupportsFloat | typing.SupportsIndex, end: typing.SupportsFloat | typing.SupportsIndex, radius: typing.SupportsFloat | typing.SupportsIndex, *, alpha: typing.SupportsFloat | typing.SupportsIndex, step: typing.SupportsFloat | typing.SupportsIndex, max_iterations: typing.SupportsInt | typing.SupportsIndex, guess: numpy.typing.ArrayLike | None = None, margin: typing.SupportsFloat | typing.SupportsIndex = 0.0, duration: typing.SupportsFloat | typing.SupportsIndex = 1.0) -> CartMotion:
    """
    The law of the gradient descent. `sigmaik.planning.cart_motion` is what to call.
    """
def evaluate_cart_motion(flange_xy: numpy.typing.ArrayLike, x: numpy.typing.ArrayLike, radius: typing.SupportsFloat | typing.SupportsIndex, *, margin: typing.SupportsFloat | typing.SupportsIndex = 0.0, duration: typing.SupportsFloat | typing.SupportsIndex = 1.0) -> CartMotion:
    """
    Any law x (M,) [m] of the cart, such as the linear one, looked at as `cart_motion` does.
    """
def evaluate_cart_motion_plane(flange_xy: numpy.typing.ArrayLike, xy: numpy.typing.ArrayLike, radius: typing.SupportsFloat | typing.SupportsIndex, *, margin: typing.SupportsFloat | typing.SupportsIndex = 0.0, duration: typing.SupportsFloat | typing.SupportsIndex = 1.0) -> PlaneCartMotion:
    """
    Any motion xy (M, 2) [m] of the cart, such as the straight one, looked at as `cart_motion_plane` does.
    """
def forbidden_intervals(flange_xy: numpy.typing.ArrayLike, radius: typing.SupportsFloat | typing.SupportsIndex) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
    """
    λ−, λ+ (M,) [m]; ∞ and −∞ where nothing is forbidden.
    """
def plane_cart_motion(flange_xy: numpy.typing.ArrayLike, start: numpy.typing.ArrayLike, end: numpy.typing.ArrayLike, radius: typing.SupportsFloat | typing.SupportsIndex, lower: numpy.typing.ArrayLike, upper: numpy.typing.ArrayLike, *, turn: typing.SupportsFloat | typing.SupportsIndex | None = None, max_radius: typing.SupportsFloat | typing.SupportsIndex = ..., margin: typing.SupportsFloat | typing.SupportsIndex = 0.0, duration: typing.SupportsFloat | typing.SupportsIndex = 1.0, max_speed: numpy.typing.ArrayLike = ..., max_acceleration: numpy.typing.ArrayLike = ..., at_rest: bool = False) -> PlaneCartMotion:
    """
    The motion with two axes. `sigmaik.planning.cart_motion_plane` is what to call.

    lower: (2,) [m] of the axes' ranges.
    upper: (2,) [m] of the axes' ranges.
    turn: [rad] that joint 1 turns through. Motions that turn the point's azimuth by another number of
        whole turns are left out: they would not bring the arm to its taught joints. None: the winding
        is free.
    max_radius: [m] > radius + margin: the arm's reach, the farthest that the point may be from axis 1.
    margin: [m] ≥ 0, added to the radius in planning. Between samples the point can be nearer than
        radius + margin by (r/8) of the square of the angle by which a step turns the point; `clearance`
        tells.
    duration: [s] > 0 from the first to the last sample. The limits count in it.
    max_speed: [m/s] > 0 of each axis, one number for both or (2,).
    max_acceleration: [m/s²] > 0 of each axis, second differences over the samples. Where the best
        motion does not keep to the limits, the motion of the least energy that does takes its place,
        along the same way.
    at_rest: whether the cart starts and stops within max_acceleration, where max_acceleration is
        finite.
    """
def taut_string(at: numpy.typing.ArrayLike, lower: numpy.typing.ArrayLike, upper: numpy.typing.ArrayLike) -> tuple[numpy.typing.NDArray[numpy.float64], list[int]]:
    """
    The shortest string x (N,) through lower ≤ x ≤ upper over increasing `at`, and the indices of its corners.
    """
