"""
Triaxial compression of spheres
===============================

Spheres are compressed along y at a given rate, while the stress on both other axes stays 1. In a
settings file: ``loading = "triaxial"``. What the critical state of spheres is, and whether
compression predicts extension, is told in :doc:`/triaxial`.
"""

import numpy as np

import granufab as gf
from granufab import plots
from granufab.fabric import stress_tensor
from granufab.simulate.settings import Sample, Solver

sample = gf.prepare(Sample(grain_count=300, dimension=3, friction=0.1)).packing
run = gf.shear(
    sample, strain=0.2, inertial_number=2e-3, solver=Solver(tolerance=1e-3), loading="triaxial"
)

# %%
# Both lateral stresses of every recorded state are 1 within 1 %.

stress = np.array([stress_tensor(frame.packing) for frame in run.frames])[1:]
lateral = stress[:, [0, 2], [0, 2]]
print(f"lateral stresses {lateral.min():.4f} to {lateral.max():.4f}")
assert np.abs(lateral - 1).max() < 0.01

# %%
# The anisotropy follows the compression: a' is above 0.15 in the mean over the second half, and
# so is q/p.

late = run.series["eps_q"].values > 0.1
means = {name: float(run.series[name].values[late].mean()) for name in ("a_signed", "q_over_p")}
print(means)
assert min(means.values()) > 0.15

# %%
# Contacts between the spheres in the middle of the last state; compression is vertical.

figure = plots.network_3d(run.frames[-1].packing).figure
