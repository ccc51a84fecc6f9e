"""Arms in physics: a MuJoCo model made from a chain's own joints and inertias. Needs the extra "sim".

    simulation = sk.sim.Simulation(arm, actuation="velocity", payload=sk.Inertia(1.0), delay=2, seed=1)
    measured = simulation.reset(q)
    while running:
        measured = simulation.step(qdot_command)        # for one control period: measured.q, measured.qdot, measured.t

    simulation = sk.sim.Simulation(arm, actuation="torque")
    done = sk.sim.execute(simulation, plan, sk.ComputedTorque(arm))
    done.max_error, done.max_effort, done.saturated

The model has no meshes and no contacts: the arm moves in free space.
"""

from .execution import Execution, execute
from .simulation import Measurement, Simulation

__all__ = ["Execution", "Measurement", "Simulation", "execute"]
