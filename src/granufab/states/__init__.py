"""Theory on (z, a) numbers: accessible domain, Mohr circle, fits. Plain arrays in, records out."""

from granufab.states.bootstrap import Bootstrap, Estimate, autocorrelation_time
from granufab.states.compare import PairedDifference, paired_difference
from granufab.states.critical import CriticalState, critical_state
from granufab.states.domain import AccessibleDomain, saturation_slopes
from granufab.states.evolution import (
    EvolutionLaw,
    StrainStage,
    fabric_from_state,
    proportional_gradient,
)
from granufab.states.evolution_fit import EvolutionFit, fit_evolution
from granufab.states.evolution_path import predict_evolution
from granufab.states.fit import AccessibleFit, fit_accessible_states
from granufab.states.mohr import MohrCircle, critical_circle, limit_circles, mohr, tangent_line
from granufab.states.steric import (
    exclusion_angle,
    steric_anisotropy,
    steric_coordination,
    steric_margin,
    window_occupation,
)

__all__ = [
    "AccessibleDomain",
    "AccessibleFit",
    "Bootstrap",
    "CriticalState",
    "Estimate",
    "EvolutionFit",
    "EvolutionLaw",
    "MohrCircle",
    "PairedDifference",
    "StrainStage",
    "autocorrelation_time",
    "critical_circle",
    "critical_state",
    "exclusion_angle",
    "fabric_from_state",
    "fit_accessible_states",
    "fit_evolution",
    "limit_circles",
    "mohr",
    "paired_difference",
    "predict_evolution",
    "proportional_gradient",
    "saturation_slopes",
    "steric_anisotropy",
    "steric_coordination",
    "steric_margin",
    "tangent_line",
    "window_occupation",
]
