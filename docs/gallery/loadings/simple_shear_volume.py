"""
Simple shear at constant volume
===============================

Dense samples dilate when they are sheared, loose ones contract. Where the volume is held they
cannot: the pressure of a dense sample rises, that of a loose one falls. Grains are nearly rigid
(k/p = 1.6·10⁵), so the pressure rises by orders of magnitude: only the compliance of the contacts
gives way. In a settings file: ``loading = "simple-shear-volume"``, see :doc:`/solver`.
"""

import numpy as np

import granufab as gf
from granufab import plots
from granufab.simulate.settings import Sample, Solver

# %%
# Two samples: one compacted without friction, one with a friction of 0.8.

runs = {}
for label, friction in (("dense", 0.0), ("loose", 0.8)):
    sample = gf.prepare(Sample(grain_count=300, friction=friction)).packing
    runs[label] = gf.shear(
        sample, strain=0.05, inertial_number=2e-3, solver=Solver(tolerance=1e-3),
        loading="simple-shear-volume", name=label,
    )  # fmt: skip

# %%
# The solid fraction stays the same to twelve digits. The pressure of the dense sample rises more
# than tenfold, that of the loose one falls below a half.

for label, run in runs.items():
    phi, p = run.series["phi"].values, run.series["p"].values
    print(f"{label}: φ {phi[0]:.4f}, p {p[0]:.2f} -> {p[-10:].mean():.3g}")
    assert np.abs(phi / phi[0] - 1).max() < 1e-12
dense, loose = (run.series["p"].values[-10:].mean() for run in runs.values())
assert dense > 10
assert loose < 0.5

# %%
# The pressure against strain.

figure, (panel,) = plots.new_figure()
with plots.style():
    for label, run in runs.items():
        panel.semilogy(run.series["eps_q"], np.maximum(run.series["p"], 1e-4), label=label)
    panel.set_xlabel(r"shear strain $\gamma$ [-]")
    panel.set_ylabel("mean stress [p]")
    panel.legend()
