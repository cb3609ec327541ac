"""
spam: spheres and contacts as text
==================================

spam's DEM files are two texts: spheres, with the periodic box in the first line, and contacts
with normals and a scalar F_n that is negative in compression. Tangential forces are not in them,
so q/p is compared with that of the normal forces alone. See :doc:`/formats`.
"""

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from shared_packing import (
    compared,
    counted,
    edges,
    lines,
    parts,
    points,
    spheres,
)

import granufab as gf
from granufab import plots

packing = spheres(seed=17)

# %%
# Write both files, read them together, and look at the contacts.

contacts, (push, _) = packing.contacts, parts(packing)
box_line = "##PERIODIC:: " + " ".join(f"{edge:.12g}" for edge in edges(packing)) + "\n"
spheres_text = box_line + lines(
    np.arange(packing.grains.count), "Sphere", packing.grains.position, packing.grains.radius
)
contacts_text = "# idA idB nx ny nz Fn uN cx cy cz\n" + lines(
    contacts.pair, contacts.normal, -push, contacts.gap, points(packing)
)
with tempfile.TemporaryDirectory() as folder:
    grains, listed = Path(folder) / "spheres.txt", Path(folder) / "contacts.txt"
    grains.write_text(spheres_text)
    listed.write_text(contacts_text)
    run = gf.read(grains, listed)
    state = run.frames[0].packing
print(*contacts_text.splitlines()[:3], sep="\n")

# %%
# z, a and q/p must be those that numpy counts from the normal forces; twelve digits were written.

found = gf.measure(state, z_definition="z")
pushed = replace(packing, contacts=replace(contacts, force=push[:, None] * contacts.normal))
assert compared(found, counted(pushed)) < 1e-8

# %%
# The contacts that were read, as lines as wide as their normal force; what is farther is paler.

figure = plots.network_3d(state).figure
