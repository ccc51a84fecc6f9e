"""Closed-loop experiments: an arm, a path, a method, and what comes out.

    from sigmaik import experiments as ex

    experiment = ex.load("ufactory_xarm7", "extended-line")
    run = ex.run(experiment, ex.parse_method("jparse", experiment.settings), velocity_limits=True)
    for row in ex.summarize(run):
        print(row.waypoint, row.position_error)

The paths and settings are those of the J-PARSE paper (Guptasarma et al.) for the xArm7, the Gen3 and the PUMA
560, see `paths` and `settings`. `sigmaik reach` is the same on the command line. What joint limits do to a
rule is in `limits`, `sigmaik limits` on the command line. Units: m, rad, s.
"""

from .limits import (
    SCENARIOS,
    VARIANTS,
    LimitsExperiment,
    LimitsSettings,
    LimitsSummary,
    Trace,
    Trial,
    drive,
    load_limits,
    save_limits_summary,
    save_traces,
    shown_trial,
    summarize_limits,
)
from .methods import ALL_METHODS, SHORT_NAMES, NamedMethod, parse_method, parse_methods, singular_gain_sweep
from .paths import Line, Path, Segment, names, read_waypoints
from .reach import Experiment, Run, load, run
from .settings import Settings, published
from .storage import save_run, save_summary
from .summary import Summary, summarize

__all__ = [
    "ALL_METHODS",
    "SCENARIOS",
    "SHORT_NAMES",
    "VARIANTS",
    "Experiment",
    "LimitsExperiment",
    "LimitsSettings",
    "LimitsSummary",
    "Line",
    "NamedMethod",
    "Path",
    "Run",
    "Segment",
    "Settings",
    "Summary",
    "Trace",
    "Trial",
    "drive",
    "load",
    "load_limits",
    "names",
    "parse_method",
    "parse_methods",
    "published",
    "read_waypoints",
    "run",
    "save_limits_summary",
    "save_run",
    "save_summary",
    "save_traces",
    "shown_trial",
    "singular_gain_sweep",
    "summarize",
    "summarize_limits",
]
