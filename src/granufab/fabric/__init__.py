"""Measures on packings: contacts, coordination, fabric tensors, orientation, stress.

:func:`measure` gives everything of one state, :func:`measure_run` of a whole run;
:func:`select_network` picks the contacts that the finer functions take.
"""

from granufab.fabric.affine import affine_turning
from granufab.fabric.balance import balance
from granufab.fabric.balance_average import average_balance, rates_by_sampling
from granufab.fabric.balance_run import balance_run
from granufab.fabric.bootstrap import bootstrap_errors
from granufab.fabric.branches import branches
from granufab.fabric.coordination import Coordination, ZDefinition, coordination
from granufab.fabric.criterion import Criterion, parse_criterion, select_contacts, wall_support
from granufab.fabric.criterion_curves import criterion_curves, criterion_sweep
from granufab.fabric.displacements import mean_motion, nonaffine_displacement
from granufab.fabric.ensemble import late_frames
from granufab.fabric.fluctuations import fluctuations
from granufab.fabric.force_values import force_values
from granufab.fabric.forces import force_statistics
from granufab.fabric.frame_series import frame_series, with_series
from granufab.fabric.harmonics import real_harmonics, sphere_density, sphere_orientation
from granufab.fabric.homogeneity import homogeneity, local_strain
from granufab.fabric.measure import measure, quick_measure
from granufab.fabric.measure_run import measure_run
from granufab.fabric.neighbours import branch_vectors, neighbours_within
from granufab.fabric.network import Network, select_network
from granufab.fabric.orientation import orientation, symmetry_axis
from granufab.fabric.rattlers import RATTLER_RULES, backbone, minimum_contacts
from granufab.fabric.run_definitions import run_definitions
from granufab.fabric.spectrum import fluctuation_spectrum
from granufab.fabric.stress import solid_fraction, stress_ratio, stress_tensor
from granufab.fabric.stress_force_fabric import anisotropy_stress_ratio, stress_force_fabric
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
from granufab.fabric.texture import texture
from granufab.fabric.velocity_field import velocity_field

__all__ = [
    "RATTLER_RULES",
    "Coordination",
    "Criterion",
    "Network",
    "ZDefinition",
    "affine_turning",
    "anisotropy",
    "anisotropy_bias",
    "anisotropy_noise",
    "anisotropy_stress_ratio",
    "average_balance",
    "backbone",
    "balance",
    "balance_run",
    "bootstrap_errors",
    "branch_vectors",
    "branches",
    "coordination",
    "criterion_curves",
    "criterion_sweep",
    "deviatoric_part",
    "enriched_tensor",
    "fabric_tensor",
    "fluctuation_spectrum",
    "fluctuations",
    "force_statistics",
    "force_values",
    "fourth_order_tensor",
    "frame_series",
    "homogeneity",
    "intermediate_ratio",
    "late_frames",
    "local_strain",
    "major_angle",
    "major_direction",
    "mean_motion",
    "mean_part",
    "measure",
    "measure_run",
    "minimum_contacts",
    "neighbours_within",
    "nonaffine_displacement",
    "orientation",
    "parse_criterion",
    "principal_values",
    "quick_measure",
    "rates_by_sampling",
    "real_harmonics",
    "run_definitions",
    "select_contacts",
    "select_network",
    "signed_anisotropy",
    "solid_fraction",
    "sphere_density",
    "sphere_orientation",
    "stress_force_fabric",
    "stress_ratio",
    "stress_tensor",
    "symmetry_axis",
    "texture",
    "velocity_field",
    "wall_support",
    "with_series",
]
