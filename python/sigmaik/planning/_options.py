"""The planners' options by keyword, as the C++ structs of the same names have them. Written by `make stubs`."""

from __future__ import annotations

import typing

import numpy.typing

__all__ = [
    "TimeOptimalOptions",
    "GradientOptions",
    "StochasticOptions",
    "CartOptions",
    "PlaneCartOptions",
]


class TimeOptimalOptions(typing.TypedDict, total=False):
    """Each option that is left out has its default."""

    nodes: typing.SupportsInt | typing.SupportsIndex
    """N, 5 to 10 000. Default: 30."""
    time_weight: typing.SupportsFloat | typing.SupportsIndex
    """[1/s] > 0. Default: 1.0."""
    effort_weight: typing.SupportsFloat | typing.SupportsIndex
    """[s⁴/rad²] ≥ 0, and > 0 where a joint has no acceleration limit. Default: 1.0."""
    tolerance: typing.SupportsFloat | typing.SupportsIndex
    """in [1e-12, 1e-2], what is left to gain, as a part of the objective between the ends. Default: 1e-09."""
    max_iterations: typing.SupportsInt | typing.SupportsIndex
    """≥ 1, Newton steps of a start. Default: 500."""
    between_nodes: bool
    """whether the motion keeps the position limits between the nodes too, where a parabola can overshoot. False: at the
    nodes alone, as in the paper. Default: True."""
    restarts: bool
    """whether the planner also searches on the other sides, where the motion found still leads through what the cost
    marks. Default: True."""
    clearance_width: typing.SupportsFloat | typing.SupportsIndex
    """[1/rad²] > 0: sets of codimension above 1 count as crossed where ψ < 1/(2 clearance_width). Where a call has
    eta2, its default is eta2. Default: 400.0."""
    whole_turns: bool
    """whether goals count whole turns. False: continuous joints take the shorter way, of at most half a turn. Default:
    False."""


class GradientOptions(typing.TypedDict, total=False):
    """Each option that is left out has its default."""

    states: typing.SupportsInt | typing.SupportsIndex
    """N + 1, 3 to 1000 support states, ends included. Default: 21."""
    prior_weight: typing.SupportsFloat | typing.SupportsIndex
    """> 0, of ‖q − μ‖² against the cost. Default: 10.0."""
    max_iterations: typing.SupportsInt | typing.SupportsIndex
    """≥ 1. Default: 100."""
    tolerance: typing.SupportsFloat | typing.SupportsIndex
    """≥ 0: the search stops where an iteration gains less than this part of the objective. Default: 0.0001."""
    restarts: typing.SupportsInt | typing.SupportsIndex
    """≥ 0. Where the motion found from the straight line touches an obstacle, so many other motions are found from
    first guesses drawn from the prior, the same each time, with a standard deviation of 0.5 rad or m half-way. The
    motion of least cost that touches no obstacle is the answer. Default: 8."""
    duration: typing.SupportsFloat | typing.SupportsIndex | None
    """[s] > 0. None: the shortest that keeps the limits of velocity and acceleration, 1 s where there are none.
    Default: None."""
    whole_turns: bool
    """whether goals count whole turns. False: continuous joints take the shorter way, of at most half a turn. Default:
    False."""


class StochasticOptions(typing.TypedDict, total=False):
    """Each option that is left out has its default."""

    states: typing.SupportsInt | typing.SupportsIndex
    """N + 1, 3 to 1000 support states, ends included. Default: 21."""
    samples: typing.SupportsInt | typing.SupportsIndex
    """≥ 2, motions drawn in an iteration. Default: 10."""
    max_iterations: typing.SupportsInt | typing.SupportsIndex
    """≥ 1. Default: 30."""
    deviation: typing.SupportsFloat | typing.SupportsIndex
    """[rad or m] > 0, standard deviation of the samples half-way. Default: 0.5."""
    decay: typing.SupportsFloat | typing.SupportsIndex
    """in (0, 1], of the deviation from one iteration to the next. Default: 0.98."""
    temperature: typing.SupportsFloat | typing.SupportsIndex
    """> 0: a sample weighs exp(−(G − G_min)/(temperature (G_max − G_min))). Default: 0.1."""
    prior_weight: typing.SupportsFloat | typing.SupportsIndex
    """≥ 0, of ‖q − μ‖² against the cost. Default: 10.0."""
    tolerance: typing.SupportsFloat | typing.SupportsIndex
    """≥ 0: the search stops where eight iterations together gain less than this part of the objective. Default:
    0.001."""
    refine: bool
    """whether `gradient` finishes the motion that the samples found. Default: False."""
    duration: typing.SupportsFloat | typing.SupportsIndex | None
    """[s] as for `gradient`. Default: None."""
    whole_turns: bool
    """whether goals count whole turns. False: continuous joints take the shorter way, of at most half a turn. Default:
    False."""


class CartOptions(typing.TypedDict, total=False):
    """Each option that is left out has its default."""

    turn: typing.SupportsFloat | typing.SupportsIndex | None
    """[rad] that joint 1 turns through from the first to the last sample. Laws that turn the point's azimuth by another
    number of whole turns are left out: they would bring the arm to its last pose, but not to its taught joints. None:
    the winding is not checked. Default: None."""
    margin: typing.SupportsFloat | typing.SupportsIndex
    """[m] ≥ 0, added to the radius in planning. Between samples the law can be nearer than radius + margin by
    max|Δ²λ|/8. Default: 0.0."""
    duration: typing.SupportsFloat | typing.SupportsIndex
    """[s] > 0 from the first to the last sample. The limits count in it. Default: 1.0."""
    max_speed: typing.SupportsFloat | typing.SupportsIndex
    """[m/s] > 0 of the cart. A law within the speed limit is found if there is one. Default: inf."""
    max_acceleration: typing.SupportsFloat | typing.SupportsIndex
    """[m/s²] > 0 of the cart, second differences over the samples. Where the law of the least energy accelerates too
    much, the law of the least energy that does not takes its place, on the same sides, by an interior-point method;
    other sides are not tried. Default: inf."""
    at_rest: bool
    """whether the cart starts and stops within max_acceleration, where max_acceleration is finite. Default: False."""


class PlaneCartOptions(typing.TypedDict, total=False):
    """Each option that is left out has its default."""

    turn: typing.SupportsFloat | typing.SupportsIndex | None
    """[rad] that joint 1 turns through. Motions that turn the point's azimuth by another number of whole turns are left
    out: they would not bring the arm to its taught joints. None: the winding is free. Default: None."""
    max_radius: typing.SupportsFloat | typing.SupportsIndex
    """[m] > radius + margin: the arm's reach, the farthest that the point may be from axis 1. Default: inf."""
    margin: typing.SupportsFloat | typing.SupportsIndex
    """[m] ≥ 0, added to the radius in planning. Between samples the point can be nearer than radius + margin by (r/8)
    of the square of the angle by which a step turns the point; `clearance` tells. Default: 0.0."""
    duration: typing.SupportsFloat | typing.SupportsIndex
    """[s] > 0 from the first to the last sample. The limits count in it. Default: 1.0."""
    max_speed: numpy.typing.ArrayLike
    """[m/s] > 0 of each axis, one number for both or (2,). Default: inf."""
    max_acceleration: numpy.typing.ArrayLike
    """[m/s²] > 0 of each axis, second differences over the samples. Where the best motion does not keep to the limits,
    the motion of the least energy that does takes its place, along the same way. Default: inf."""
    at_rest: bool
    """whether the cart starts and stops within max_acceleration, where max_acceleration is finite. Default: False."""
