"""
Biaxial compression with constant lateral stress
================================================

The sample is compressed along y at a given rate, while the stress along x stays 1. The mean
stress rises with the deviator, so q/p is what tells how close the sample is to its limit. In a
settings file: ``loading = "biaxial"``, see :doc:`/solver`.
"""

import numpy as np

import granufab as gf
from granufab import plots
from granufab.fabric import stress_tensor
from granufab.plots.style import COLOURS
from granufab.simulate.settings import Sample, Solver

sample = gf.prepare(Sample(grain_count=300, friction=0.0)).packing
run = gf.shear(
    sample, strain=0.2, inertial_number=2e-3, solver=Solver(tolerance=1e-3), loading="biaxial"
)

# %%
# The lateral stress of every recorded state is 1 within 1 %, the axial one rises above 1.4 in the
# mean.

strain = np.array([frame.eps_q for frame in run.frames])
stress = np.array([stress_tensor(frame.packing) for frame in run.frames])
lateral, axial = stress[1:, 0, 0], stress[1:, 1, 1]
print(f"lateral {lateral.min():.4f} to {lateral.max():.4f}, axial {axial.mean():.2f} in the mean")
assert np.abs(lateral - 1).max() < 0.01
assert axial.mean() > 1.4

# %%
# What happens to the area follows from both rates: a dense sample dilates under shear, here by
# more than 0.5 %.

phi = run.series["phi"].values
print(f"solid fraction {phi[0]:.4f} -> {phi[-1]:.4f}")
assert phi[0] / phi[-1] - 1 > 0.005

# %%
# Both stresses against strain, and the solid fraction.

figure, (above, below) = plots.new_figure(rows=2, height=4.2)
with plots.style():
    above.plot(strain[1:], axial, "o-", color=COLOURS[1], label=r"$\sigma_{yy}$, axial")
    above.plot(strain[1:], lateral, "o-", color=COLOURS[0], label=r"$\sigma_{xx}$, lateral")
    above.set_ylabel("stress [p]")
    above.legend(loc="center right")
    below.plot(run.series["eps_q"], phi, color=COLOURS[2])
    below.set_ylabel(r"solid fraction $\phi$ [-]")
    below.set_xlabel(r"$\varepsilon_q$ [-]")
