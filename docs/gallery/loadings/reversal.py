"""
Reversal of shear
=================

A sample is sheared to the critical state and then the other way. The contacts remember the first
direction: the signed anisotropy a' falls to zero and grows again with the other sign, within
about a tenth of strain. In a settings file a second stage has a negative strain. The equations of
the evolution, and how well they fit it, are in :doc:`/evolution`.
"""

import numpy as np

import granufab as gf
from granufab import plots
from granufab.simulate.settings import Case, Sample, Solver, Stage

forward = Stage(loading="constant-mean", strain=0.15, inertial_number=2e-3)
case = Case(
    sample=Sample(grain_count=300),
    solver=Solver(tolerance=1e-3),
    path=(forward, forward.model_copy(update={"strain": -0.25})),
)
run = gf.run_case(case)

# %%
# a' before the reversal is above 0.15 and in the last tenth of the strain below −0.1. It is zero
# somewhere within a strain of 0.15 after the reversal.

walked, a = run.series["eps_q_total"].values, run.series["a_signed"].values
before = a[(walked > 0.1) & (walked <= 0.15)].mean()
after = a[walked > 0.3].mean()
zero = walked[(walked > 0.15) & (a < 0)].min() - 0.15
print(f"a' {before:.3f} before, {after:.3f} after, first below zero after a strain of {zero:.3f}")
assert before > 0.15
assert after < -0.1
assert zero < 0.15

# %%
# The mean stress is held within 1 % throughout, also where the rate changes sign.

p = run.series["p"].values
print(f"p from {p.min():.4f} to {p.max():.4f}")
assert np.abs(p - 1).max() < 0.01

# %%
# z and a' against the strain that was walked; the dotted line marks the reversal.

figure = plots.series(run)[0].figure
