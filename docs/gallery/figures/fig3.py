"""
Figure 3: orientations before and after shearing
================================================

E(θ), contacts per grain and direction, before and after a strain of 0.3, of disks and of spheres,
with the second-order fit. Contraction is at θ = 0. What the higher orders are, and how to do this
with your own contacts, is in :doc:`/orientation`; the full size is in :doc:`/figures`.
"""

from shared_size import small

numbers, picture = small("fig3")

# %%
# Before, a is zero within three standard errors. After, a is above 0.1 and above two errors.

for name, states in numbers["orientation"].items():
    a = {when: (state["a_fitted"], state["a_error"]) for when, state in states.items()}
    print(name, {when: f"{value:.3f} ± {error:.3f}" for when, (value, error) in a.items()})
    assert abs(a["before"][0]) < 3 * a["before"][1]
    assert a["after"][0] > max(0.1, 2 * a["after"][1])

# %%
# Contacts prefer the direction of contraction, within 20° for this number of contacts.

angle = numbers["orientation"]["disks"]["after"]["theta_c_degrees"]
print(f"preferred direction {angle:.1f}° from contraction")
assert abs(angle) < 20
