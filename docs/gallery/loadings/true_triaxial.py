"""
True triaxial shear of spheres
==============================

Three different rates: along y the sample contracts, along the axis after it, z, it extends, and b
says where the third lies: b = (ε̇2 − ε̇3)/(ε̇1 − ε̇3). b = 0 is triaxial compression, 1/2 is
plane shear and b = 1 two equal contractions. The mean stress is held. In a settings file: ``b =
0.5`` in a stage of ``constant-mean``. The anisotropy a' is then measured between the first and
the last axis; see :doc:`/solver` and :doc:`/triaxial`.
"""

import numpy as np

import granufab as gf
from granufab import plots
from granufab.fabric import stress_tensor
from granufab.plots.style import COLOURS
from granufab.simulate.settings import Case, Sample, Solver, Stage

case = Case(
    sample=Sample(grain_count=300, dimension=3, friction=0.1),
    solver=Solver(tolerance=1e-3),
    path=(Stage(loading="constant-mean", b=0.5, strain=0.2, inertial_number=2e-3),),
)
run = gf.run_case(case)

# %%
# The rates of the last state give b back, exactly, and the mean stress is held within 1 %.

rates = -np.diag(run.frames[-1].packing.cell.rate)
first, third, second = rates[1], rates[2], rates[0]
b = (second - third) / (first - third)
p = run.series["p"].values
print(f"b {b:.12f}, p from {p.min():.4f} to {p.max():.4f}")
assert abs(b - 0.5) < 1e-9
assert np.abs(p - 1).max() < 0.01

# %%
# The principal stresses follow in the order of the rates, in the mean over the second half at
# least 0.05 apart.

stress = np.array([np.diag(stress_tensor(frame.packing)) for frame in run.frames])
strain = np.array([frame.eps_q for frame in run.frames])
mean = stress[strain > 0.1].mean(axis=0)
print(f"stress along y {mean[1]:.2f}, x {mean[0]:.2f}, z {mean[2]:.2f}")
assert mean[1] > mean[0] + 0.05 > mean[2] + 0.1

# %%
# The three stresses against strain.

figure, (panel,) = plots.new_figure()
with plots.style():
    for axis, label, colour in ((1, "y, contracts", 1), (0, "x, between", 2), (2, "z, extends", 0)):
        panel.plot(strain[1:], stress[1:, axis], "o-", color=COLOURS[colour], label=label)
    panel.set_xlabel(r"$\varepsilon_q$ [-]")
    panel.set_ylabel("stress [p]")
    panel.set_ylim(0.4, 2.2)
    panel.legend()
