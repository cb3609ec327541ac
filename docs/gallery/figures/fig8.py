"""
Figure 8: friction in the (z, az) plane
=======================================

One sample sheared with five friction coefficients: each path has its own critical state and its
own domain. How to sweep a parameter of your own is in :doc:`/campaigns`; the full size is in
:doc:`/figures`.
"""

import numpy as np
from shared_size import small

numbers, picture = small("fig8")

# %%
# All paths start from the same sample, so z_0 is the same number.

friction = np.array([path["friction"] for path in numbers["paths"]])
starts = {path["z_0"] for path in numbers["paths"]}
print("z_0", starts)
assert len(starts) == 1

# %%
# z* falls with µ, by more than 0.5 from 0.1 to 0.9. Near µ = 0.9 the steps are of the size of the
# scatter of 300 grains, so a rise of up to 0.03 would pass.

z = np.array([path["z_star"]["value"] for path in numbers["paths"]])
print("µ", friction, "z*", z.round(3))
assert (np.diff(z) < 0.03).all()
assert z[0] - z[-1] > 0.5
