"""Measures on packings: contacts, coordination, fabric tensors, orientation, stress.

:func:`measure` gives everything of one state, :func:`measure_run` of a whole run;
:func:`select_network` picks the contacts that the finer functions take.
"""

from granufab.fabric.bootstrap import bootstrap_errors
from granufab.fabric.coordination import Coordination, ZDefinition, coordination
from granufab.fabric.criterion import Criterion, parse_criterion, select_contacts, wall_support
from granufab.fabric.homogeneity import homogeneity, local_strain
from granufab.fabric.measure import criterion_sweep, measure, measure_run, quick_measure
from granufab.fabric.neighbours import branch_vectors, neighbours_within
from granufab.fabric.network import Network, select_network
from granufab.fabric.orientation import orientation, symmetry_axis
from granufab.fabric.rattlers import RATTLER_RULES, backbone, minimum_contacts
from granufab.fabric.stress import solid_fraction, stress_ratio, stress_tensor
from granufab.fabric.tensors import (
    anisotropy,
    anisotropy_bias,
    anisotropy_noise,
    deviatoric_part,
    enriched_tensor,
    fabric_tensor,
    fourth_order_tensor,
    intermediate_ratio,
    major_angle,
    major_direction,
    mean_part,
    principal_values,
    signed_anisotropy,
)

__all__ = [
    "RATTLER_RULES",
    "Coordination",
    "Criterion",
    "Network",
    "ZDefinition",
    "anisotropy",
    "anisotropy_bias",
    "anisotropy_noise",
    "backbone",
    "bootstrap_errors",
    "branch_vectors",
    "coordination",
    "criterion_sweep",
    "deviatoric_part",
    "enriched_tensor",
    "fabric_tensor",
    "fourth_order_tensor",
    "homogeneity",
    "intermediate_ratio",
    "local_strain",
    "major_angle",
    "major_direction",
    "mean_part",
    "measure",
    "measure_run",
    "minimum_contacts",
    "neighbours_within",
    "orientation",
    "parse_criterion",
    "principal_values",
    "quick_measure",
    "select_contacts",
    "select_network",
    "signed_anisotropy",
    "solid_fraction",
    "stress_ratio",
    "stress_tensor",
    "symmetry_axis",
    "wall_support",
]
