"""
Rockable: a conf file
=====================

Rockable's ``conf`` names a file of shapes and lists particles and interactions. The normal points
to the first body and the forces act on it. Shapes may be sphero-polyhedra, which touch in several
points; here they are spheres. See :doc:`/formats`.
"""

import tempfile
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

packing = spheres(seed=16)

# %%
# Write the shape and the conf, read the conf.

grains, contacts = packing.grains, packing.contacts
push, across = parts(packing)
cell = " ".join(f"{number:.12g}" for number in np.diag(edges(packing)).ravel())
shapes = "<\nname Ball\nradius 0.5\npreCompDone y\nnv 1\n0 0 0\n>\n"
conf = f"Rockable 21-08-2022\nt {packing.time}\nusePeriodicCell 1\nh {cell}\n"
conf += f"density 0 1\nnDriven 0\nshapeFile balls.shp\nParticles {grains.count}\n" + lines(
    "Ball 0 0", 2 * grains.radius, grains.position, "0 0 0 0 0 0 1 0 0 0 0 0 0 0 0 0"
)
conf += f"Interactions {contacts.count}\n" + lines(
    contacts.pair, "0 0 0", -contacts.normal, contacts.gap, points(packing), "0 0 0", push,
    -across, "0 0 0 0",
)  # fmt: skip
with tempfile.TemporaryDirectory() as folder:
    (Path(folder) / "balls.shp").write_text(shapes)
    (Path(folder) / "conf1").write_text(conf)
    run = gf.read(Path(folder) / "conf1")
    state = run.frames[0].packing
print(*run.frames.summary.lines(), sep="\n")

# %%
# z, a and q/p must be those that numpy counts in the packing; twelve digits were written.

found = gf.measure(state, z_definition="z")
assert compared(found, counted(packing)) < 1e-8

# %%
# The contacts that were read, as lines as wide as their normal force; what is farther is paler.

figure = plots.network_3d(state).figure
