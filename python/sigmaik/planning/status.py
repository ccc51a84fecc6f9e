"""How a plan ended."""

from __future__ import annotations

from enum import Enum

__all__ = ["PlanStatus"]


class PlanStatus(str, Enum):
    """Each member equals its text: ``plan.status == "optimal"``."""

    OPTIMAL = "optimal"
    """A local minimum, to the tolerance."""
    FEASIBLE = "feasible"
    """Within all constraints, but not at a minimum."""
    FAILED = "failed"
    """No motion within the constraints was found, and none is returned."""

    def __str__(self) -> str:
        return self.value

    def __format__(self, format_spec: str) -> str:
        return format(self.value, format_spec)
