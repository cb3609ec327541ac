"""Figures of a journal's column: functions take results and return matplotlib axes."""

from __future__ import annotations

from granufab.plots.balance import attribution, balance, sampling_rates
from granufab.plots.branches import branches, branches_joint
from granufab.plots.criterion_curves import criterion_curves
from granufab.plots.environment import contact_geometry, grain_environment
from granufab.plots.evolution import evolution
from granufab.plots.fluctuations import (
    fluctuation_growth,
    fluctuation_kurtosis,
    fluctuation_pdf,
    fluctuation_spectrum,
    fluctuations,
)
from granufab.plots.forces import force_density, mobilisation
from granufab.plots.homogeneity import homogeneity
from granufab.plots.mohr import mohr
from granufab.plots.network import network
from granufab.plots.network_3d import network_3d
from granufab.plots.parameters import parameter_curves
from granufab.plots.path import path
from granufab.plots.rose import rose
from granufab.plots.rose_3d import rose_surface
from granufab.plots.series import series
from granufab.plots.stress_force_fabric import stress_force_fabric, stress_ratios
from granufab.plots.style import new_figure, save, style
from granufab.plots.texture import occupation, texture
from granufab.plots.velocity_field import velocity_field, velocity_panels, velocity_profile
from granufab.plots.zaz import zaz

__all__ = [
    "attribution",
    "balance",
    "branches",
    "branches_joint",
    "contact_geometry",
    "criterion_curves",
    "evolution",
    "fluctuation_growth",
    "fluctuation_kurtosis",
    "fluctuation_pdf",
    "fluctuation_spectrum",
    "fluctuations",
    "force_density",
    "grain_environment",
    "homogeneity",
    "mobilisation",
    "mohr",
    "network",
    "network_3d",
    "new_figure",
    "occupation",
    "parameter_curves",
    "path",
    "rose",
    "rose_surface",
    "sampling_rates",
    "save",
    "series",
    "stress_force_fabric",
    "stress_ratios",
    "style",
    "texture",
    "velocity_field",
    "velocity_panels",
    "velocity_profile",
    "zaz",
]
