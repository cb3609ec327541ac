"""
Biaxial shear at constant mean stress
=====================================

The loading of the paper: the deviatoric strain rate is imposed, and the cell dilates so that the
mean stress stays what it was. A dense sample loses contacts at once, builds up anisotropy and
reaches the critical state. In a settings file this is ``loading = "constant-mean"``, the default;
see :doc:`/solver` and :doc:`/states`.
"""

import numpy as np

import granufab as gf
from granufab import plots
from granufab.simulate.settings import Sample, Solver

sample = gf.prepare(Sample(grain_count=300, friction=0.0)).packing
run = gf.shear(
    sample, strain=0.2, inertial_number=2e-3, solver=Solver(tolerance=1e-3), loading="constant-mean"
)

# %%
# The mean stress is held within 1 % at every record; nothing controls it, the cell is a body that
# is solved together with the contacts.

p = run.series["p"].values
print(f"p from {p.min():.4f} to {p.max():.4f}")
assert np.abs(p - 1).max() < 0.01

# %%
# Contacts are lost, by more than 0.5 a grain, and what remains is oriented: a' is above 0.15 in
# the mean over the second half.

z, a = run.series["z_backbone"].values, run.series["a_signed"].values
late = run.series["eps_q"].values > 0.1
print(f"z {z[0]:.2f} -> {z[late].mean():.2f}, a' {a[0]:.2f} -> {a[late].mean():.2f}")
assert z[0] - z[late].mean() > 0.5
assert a[late].mean() > 0.15

# %%
# z and a' against strain.

figure = plots.series(run)[0].figure
