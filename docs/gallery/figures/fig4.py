"""
Figure 4: relative velocities around a grain
============================================

Mean velocities of the neighbours of a grain in simple shear, beside those of the affine field,
averaged over the states after ε_q = 0.1. How the field is averaged, and how far the disturbance
reaches, is in :doc:`/velocity`; the full size is in :doc:`/figures`.
"""

import numpy as np
from shared_size import small

numbers, picture = small("fig4", grains=400)
field = numbers["velocity_field"]

# %%
# Far from the grain the gradient is the imposed one, within a tenth of it: γ̇ of the flow is 1 in
# these units.

far, imposed = np.array(field["rate_far"]), np.array(field["rate"])
print("far field", far.round(3).tolist(), "imposed", imposed.round(3).tolist())
assert np.abs(far - imposed).max() < 0.1

# %%
# Grains in contact hardly approach each other: at distances of 0.85 to 1 mean branches less than
# half of the affine velocity along the branch is left.

distance = np.array(field["distance"], float) / field["mean_branch"]
share = np.array(field["normal_share"], float)
near = float(np.nanmean(share[(distance > 0.85) & (distance < 1)]))
print(f"share of the affine velocity near contact {near:.2f}")
assert near < 0.5
