"""The command `sigmaik cart`."""

from __future__ import annotations

import argparse
import pathlib

from ._extras import need
from .console import terminal
from .experiments import cart
from .planning.cart import PUBLISHED_ITERATIONS

__all__ = ["add_cart"]


def add_cart(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "A UR10 on a cart passes its shoulder singularity (Salvato et al. 2022): the cart driven linearly, by a "
        "redundancy scheme, by the paper's gradient descent, and by the exact law, along one axis and in the plane. "
        "Prints who crosses the forbidden region and who misses the taught joints, and draws the paper's "
        "figures 3 to 9. The last line on stdout is the last file."
    )
    parser.add_argument(
        "--variant",
        choices=(*cart.VARIANTS, "both"),
        default="both",
        help="fk: poses of the paper's joints; paper: the paper's poses, with a tool that makes them fit (%(default)s)",
    )
    parser.add_argument("--method", default=",".join(cart.METHODS), metavar="LIST", help="some of %(default)s")
    parser.add_argument(
        "--samples", type=int, default=5068, metavar="M", help="of the motion; the paper's are %(default)s"
    )
    parser.add_argument(
        "--iterations",
        type=int,
        default=PUBLISHED_ITERATIONS,
        metavar="N",
        help="of the gradient descent; the paper's are %(default)s",
    )
    out = parser.add_argument_group("what is written")
    out.add_argument("--out", default="sigmaik-cart", type=pathlib.Path, metavar="DIR", help="(%(default)s)")
    out.add_argument("--no-plot", action="store_true", help="no pictures")
    parser.set_defaults(run=_cart)


def _cart(arguments: argparse.Namespace) -> int:
    console = terminal()
    if not arguments.no_plot:
        need("matplotlib")
    if arguments.iterations < 1:
        raise ValueError("--iterations must be at least 1")
    methods = arguments.method.split(",")
    for method in methods:
        if method not in cart.METHODS:
            raise ValueError(f"no method {method!r}; there are {', '.join(cart.METHODS)}")

    from .experiments.cart_table import cart_table, save_cart_table

    for variant in cart.VARIANTS if arguments.variant == "both" else (arguments.variant,):
        experiment = cart.experiment(variant, arguments.samples)
        runs = [cart.run(experiment, method, arguments.iterations) for method in methods]
        console.print(cart_table(experiment, runs))
        last = save_cart_table(experiment, runs, arguments.out / f"cart-{variant}.csv")
        if not arguments.no_plot:
            from . import plots, plots_cart

            print(f"table: {last}")
            stops = [n for n in (100, 1000, 10000) if n < arguments.iterations] + [arguments.iterations]
            stages = [cart.descent(experiment, guess, stops) for guess in ("linear", "admissible")]
            laws = plots_cart.laws_figure(experiment, runs, *stages)
            joints = plots_cart.joints_figure(experiment, runs)
            print(f"picture: {plots.save_figure(laws, arguments.out / f'cart-{variant}-laws.png')}")
            exact = [run for run in runs if run.method in ("exact", "plane")]
            if len(exact) == 2:
                plane = plots_cart.plane_figure(experiment, exact)
                print(f"picture: {plots.save_figure(plane, arguments.out / f'cart-{variant}-plane.png')}")
            last = plots.save_figure(joints, arguments.out / f"cart-{variant}-joints.png")
        print(last)
    return 0
