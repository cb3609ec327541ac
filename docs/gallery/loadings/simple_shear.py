"""
Simple shear with the normal stress held
========================================

The cell is sheared along x with the gradient along y, at constant σ_yy. Contraction is then at
45° to both axes: the principal direction of the contacts lies near 135° from x. In a settings
file: ``loading = "simple-shear"``, see :doc:`/solver`; velocities around a grain in this flow are
the subject of :doc:`/velocity`.
"""

import numpy as np

import granufab as gf
from granufab import plots
from granufab.fabric import stress_tensor
from granufab.simulate.settings import Sample, Solver

sample = gf.prepare(Sample(grain_count=300, friction=0.0)).packing
run = gf.shear(
    sample, strain=0.3, inertial_number=2e-3, solver=Solver(tolerance=1e-3), loading="simple-shear"
)

# %%
# The normal stress of every recorded state is 1 within 1 %.

stress = np.array([stress_tensor(frame.packing) for frame in run.frames])[1:]
print(f"normal stress {stress[:, 1, 1].min():.4f} to {stress[:, 1, 1].max():.4f}")
assert np.abs(stress[:, 1, 1] - 1).max() < 0.01

# %%
# Contacts prefer the direction of contraction: the principal direction of the mean fabric over
# the second half is within 10° of 135°.

tensors = []
for frame in run.frames[len(run.frames) // 2 :]:
    normal = gf.fabric.select_network(frame.packing).contacts.normal
    tensors.append(normal.T @ normal / len(normal))
fabric = np.mean(tensors, axis=0)
angle = 0.5 * np.degrees(np.arctan2(2 * fabric[0, 1], fabric[0, 0] - fabric[1, 1])) % 180
print(f"principal direction {angle:.1f}°")
assert abs(angle - 135) < 10

# %%
# The last state in its sheared cell; lines are as wide as the normal force.

figure = plots.network(run.frames[-1].packing).figure
