"""
Figure 2: contact geometry and angular exclusions
=================================================

One contact with its branch, contact vector and normal, and one grain with its neighbours and the
angles δθ that its neighbours' sizes exclude. Both are real grains of a sheared sample, to scale.
What follows from the exclusions for z is in :doc:`/texture`; the full size is in :doc:`/figures`.
"""

import numpy as np
from shared_size import small

numbers, picture = small("fig2")

# %%
# Of disks the branch is the sum of both radii along the normal: within a thousandth, since grains
# are nearly rigid.

contact = numbers["contact"]
ratio = contact["branch_length"] / sum(contact["radii"])
print(f"branch over the sum of the radii {ratio:.6f}")
assert abs(ratio - 1) < 1e-3

# %%
# Going round the grain, the angles to the next contact sum to a full turn, and none is smaller
# than what the sizes exclude, by more than 1°.

around = numbers["environment"]
angles, exclusions = (
    np.array(around[f"{name}_to_next_degrees"]) for name in ("angle", "exclusion")
)
print("angles", angles.round(1), "excluded", exclusions.round(1))
assert abs(angles.sum() - 360) < 1e-6
assert (angles > exclusions - 1).all()

# %%
# For equal disks δθ is 60°; the mean over the sizes of the sample is within 1° of it.

mean = numbers["texture"]["delta_theta_geometric_degrees"]
print(f"mean of the exclusions {mean:.2f}°")
assert abs(mean - 60) < 1
