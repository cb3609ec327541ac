"""
Figure 6: the Mohr representation
=================================

The fabric as a circle: its centre is z/4, its radius a z/8, and what it meets on the axis are the
contacts along contraction and along extension. Steric exclusion and force balance limit both
ends. The figure is explained in :doc:`/concepts` and :doc:`/states`; the full size is in
:doc:`/figures`.
"""

import numpy as np
from shared_size import small

numbers, picture = small("fig6")
fit = numbers["fit"]["default"]
z, a = fit["z_star"]["value"], fit["a_star"]["value"]

# %%
# The critical circle is that of (z*, a*), and touches the cone whose angle α has sin α = a*/2.
# Both are identities of the theory, to twelve digits.

circle = numbers["mohr"]["critical"]
angle = np.radians(numbers["mohr"]["tangent_angle_degrees"])
print(f"z* {z:.3f}, a* {a:.3f}, centre {circle['centre']:.4f}, radius {circle['radius']:.4f}")
assert abs(circle["centre"] - z / 4) < 1e-12
assert abs(circle["radius"] - a * z / 8) < 1e-12
assert abs(np.sin(angle) - a / 2) < 1e-12

# %%
# At a strain of 0.02 the dense sample is more anisotropic than the loose one: its circle is
# wider.

dense, loose = (one["radius"] for one in numbers["mohr"]["circles"])
print(f"radius at ε_q = 0.02: dense {dense:.4f}, loose {loose:.4f}")
assert dense > loose
