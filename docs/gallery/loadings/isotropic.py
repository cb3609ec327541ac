"""
Isotropic compression to a wanted z
===================================

A dilute random sample is compressed under a mean stress p until it is at rest. How many contacts
it ends with depends on the friction during compaction: none gives the largest z, much friction
the smallest. ``coordination=`` asks for a z_0, which is reached by changing that friction.
Without friction and with rigid grains the number of contacts is not free: N_c = D N_b − D + 1,
where N_b are the grains that bear and 1 stands for the dilation of the cell. See *Samples* in
:doc:`/solver`.
"""

import numpy as np

import granufab as gf
from granufab import plots
from granufab.fabric import select_network
from granufab.simulate.settings import Sample

# %%
# A sample with a wanted z_0 = 3.6. It must be met within 0.05, at a mean stress of 1 within 1 %.

wanted = gf.prepare(Sample(grain_count=300, coordination=3.6))
values = gf.measure(wanted.packing)
z, p = values["z_backbone"], values["p"]
print(f"z_0 {z:.3f}, p {p:.4f}, compaction friction {wanted.friction:.3f}")
assert abs(z - 3.6) < 0.05
assert abs(p - 1) < 0.01

# %%
# Frictionless: the contacts in excess of that number are exactly 0, in 2D and in 3D. Only grains
# with at least D + 1 contacts bear.

packings = {}
for dimension in (2, 3):
    packing = gf.prepare(Sample(grain_count=300, dimension=dimension, friction=0.0)).packing
    bearing = select_network(packing, z_definition="z_backbone", minimum=dimension + 1)
    needed = dimension * bearing.grain_count - dimension + 1
    excess = bearing.contacts.count - needed
    print(f"{dimension}D: {bearing.contacts.count} contacts, {needed} needed, excess {excess}")
    assert excess == 0
    packings[dimension] = packing

# %%
# The disks, and the angles of their contacts: no direction is preferred. a is that of as many
# contacts with independent random directions, which is at most 2.5 √(π/N_c) in 99 of 100 cases.

network = select_network(packings[2])
a = gf.measure(packings[2])["a"]
chance = np.sqrt(np.pi / network.contacts.count)
print(f"a {a:.3f}, mean a of random directions {chance:.3f}")
assert a < 2.5 * chance

figure = plots.network(packings[2]).figure
