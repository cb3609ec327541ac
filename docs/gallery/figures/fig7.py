"""
Figure 7: paths in the (z, a) plane
===================================

Two samples sheared to the critical state, and the domain of accessible states fitted to them. The
paper's central figure: what the two lines mean is in :doc:`/concepts` and :doc:`/states`, and the
full size, with what agrees and what does not, in :doc:`/figures`.
"""

from shared_size import small

numbers, picture = small("fig7")

# %%
# One sample starts above the common z*, one below. Both end there, within 0.12 in z and 0.15 in
# a.

dense, loose = numbers["paths"]
for path in (dense, loose):
    z, a = path["z_star"]["value"], path["a_star"]["value"]
    print(f"{path['name']}: z_0 {path['z_0']:.2f} -> z* {z:.3f}, a* {a:.3f}")
names = ("z_star", "a_star", "z_min", "z_max")
fit = {name: numbers["fit"]["default"][name]["value"] for name in names}
assert dense["z_0"] > fit["z_star"] + 0.2 > loose["z_0"] + 0.2
assert abs(dense["z_star"]["value"] - loose["z_star"]["value"]) < 0.12
assert abs(dense["a_star"]["value"] - loose["a_star"]["value"]) < 0.15

# %%
# The critical state is where both lines meet: z* is the mean of z_min and z_max, and a* = 2
# (z_max − z_min)/(z_max + z_min).

low, high = fit["z_min"], fit["z_max"]
print(f"z_min {low:.3f}, z_max {high:.3f}")
assert abs(fit["z_star"] - (low + high) / 2) < 1e-9
assert abs(fit["a_star"] - 2 * (high - low) / (high + low)) < 1e-9
