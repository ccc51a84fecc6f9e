"""Tables 3 to 5 of Beck et al. (2022), for the tables that stand beside them."""

from __future__ import annotations

__all__ = ["PAPER"]

# By arm, objective and field of `experiment.Summary`: t_F [s], computing time [ms], m_min, m_max, m_avg, l_p [m],
# l_quat, with mean and deviation.
PAPER: dict[str, dict[str, dict[str, tuple[float, ...]]]] = {
    "comau_racer_7_1_4": {
        "none": {
            "duration": (2.3174, 0.46),
            "solve_time": (10.4, 5.8),
            "m_min": (2.01e-7,),
            "m_max": (0.466,),
            "m_avg": (0.16, 0.08),
            "l_p": (2.42, 1.35),
            "l_quat": (1.52, 1.35),
        },
        "manipulability": {
            "duration": (3.82, 0.73),
            "solve_time": (27.3, 18.3),
            "m_min": (6.6e-6,),
            "m_max": (0.466,),
            "m_avg": (0.362, 0.04),
            "l_p": (4.03, 1.6),
            "l_quat": (2.2, 1.65),
        },
        "potential": {
            "duration": (4.07, 2.15),
            "solve_time": (21.5, 15.8),
            "m_min": (1.01e-4,),
            "m_max": (0.466,),
            "m_avg": (0.19, 0.07),
            "l_p": (3.86, 2.36),
            "l_quat": (1.92, 1.46),
        },
    },
    "kuka_lbr_iiwa_14_r820": {
        "none": {
            "duration": (2.67, 0.48),
            "solve_time": (11.4, 6.3),
            "m_min": (5.25e-8,),
            "m_max": (0.159,),
            "m_avg": (0.061, 0.027),
            "l_p": (1.95, 0.90),
            "l_quat": (1.65, 1.43),
        },
        "manipulability": {
            "duration": (9.75, 1.73),
            "solve_time": (62.3, 26.7),
            "m_min": (1.82e-7,),
            "m_max": (0.16,),
            "m_avg": (0.142, 0.0035),
            "l_p": (3.34, 1.02),
            "l_quat": (3.28, 2.07),
        },
        "potential": {
            "duration": (5.03, 2.59),
            "solve_time": (43.8, 29.1),
            "m_min": (1.007e-4,),
            "m_max": (0.159,),
            "m_avg": (0.067, 0.025),
            "l_p": (2.2, 0.94),
            "l_quat": (1.99, 1.67),
        },
    },
    "franka_panda": {
        "none": {
            "duration": (2.44, 0.29),
            "solve_time": (11.1, 5.5),
            "m_min": (6.5e-6,),
            "m_max": (0.128,),
            "m_avg": (0.04, 0.02),
            "l_p": (1.34, 0.69),
            "l_quat": (1.76, 1.46),
        },
        "manipulability": {
            "duration": (11.3, 2.29),
            "solve_time": (245.3, 377.0),
            "m_min": (6.82e-5,),
            "m_max": (0.13,),
            "m_avg": (0.112, 0.012),
            "l_p": (2.37, 0.81),
            "l_quat": (3.62, 2.13),
        },
        "potential": {
            "duration": (4.96, 3.11),
            "solve_time": (72.3, 57.5),
            "m_min": (3.07e-4,),
            "m_max": (0.129,),
            "m_avg": (0.057, 0.0188),
            "l_p": (1.866, 0.953),
            "l_quat": (2.41, 1.81),
        },
    },
}
