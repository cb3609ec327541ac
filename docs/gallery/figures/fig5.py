"""
Figure 5: z and a' along the path, and a reversal
=================================================

A dense and a loose sample on their way to the critical state; the dense one is then sheared
backwards. The equations of this evolution are in :doc:`/evolution`; the full size is in
:doc:`/figures`.
"""

from shared_size import small

numbers, picture = small("fig5")

# %%
# Both starts reach one z*: they differ by less than 0.12, a fifth of what they differed at the
# start.

dense, loose = numbers["paths"]
start, end = dense["z_0"] - loose["z_0"], dense["z_star"]["value"] - loose["z_star"]["value"]
print(f"z differs by {start:.2f} at the start and by {end:.3f} in the critical state")
assert start > 0.6
assert abs(end) < 0.12

# %%
# After the reversal a' is zero within a strain of 0.1 and then reaches a plateau below −0.15.

back = numbers["reversal"]
zero, plateau = back["strain_to_zero"]["value"], back["a_signed_plateau"]["value"]
print(f"a' is zero after a strain of {zero:.3f}, then goes to {plateau:.3f}")
assert zero < 0.1
assert plateau < -0.15
