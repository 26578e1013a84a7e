"""Density control: adds Gaussians where the pictures need more, removes those that add nothing.

`growth` plans changes as 3DGS does; `strategy` is the interface for training loops; `plan` applies
a change to everything stored per Gaussian; `relocation` holds a formula of 3DGS-MCMC.
"""

from ico3d.splat.density.growth import (
    DensitySettings,
    DensityStats,
    contributions,
    densify_plan,
    reset_opacity_logits,
)
from ico3d.splat.density.plan import (
    Plan,
    Population,
    apply_plan,
    apply_plan_to_geometry,
    apply_plan_to_state,
    growth_plan,
)
from ico3d.splat.density.relocation import MAX_COPIES, relocated
from ico3d.splat.density.strategy import (
    DefaultStrategy,
    McmcSettings,
    McmcStrategy,
    Schedule,
    Strategy,
)

__all__ = [
    "MAX_COPIES",
    "DefaultStrategy",
    "DensitySettings",
    "DensityStats",
    "McmcSettings",
    "McmcStrategy",
    "Plan",
    "Population",
    "Schedule",
    "Strategy",
    "apply_plan",
    "apply_plan_to_geometry",
    "apply_plan_to_state",
    "contributions",
    "densify_plan",
    "growth_plan",
    "relocated",
    "reset_opacity_logits",
]
