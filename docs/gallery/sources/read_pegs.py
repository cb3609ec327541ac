"""
PeGS: a photoelastic experiment
===============================

PeGS, a solver for photoelastic disks, leaves ``particle_positions.txt`` and
``Adjacency_list.txt``. Measured positions are noisy, the list of contacts with their normal and
tangential force is what was measured well: contacts are those listed. Here a hundredth of a
radius of noise is put on the positions, as an image would have it. See :doc:`/formats`.
"""

import tempfile
from pathlib import Path

import numpy as np
from shared_packing import box, compared, counted, disks, lines, parts

import granufab as gf
from granufab import plots

packing = disks(seed=14)

# %%
# Write both files and read the folder. An experiment has walls; the cell is given here because
# this packing is periodic.

grains, contacts = packing.grains, packing.contacts
noise = np.random.default_rng(3).normal(0, 0.01 * grains.radius.mean(), grains.position.shape)
tangent = np.column_stack([-contacts.normal[:, 1], contacts.normal[:, 0]])
along = np.einsum("ci,ci->c", contacts.force, tangent)
numbers = np.arange(grains.count) + 1
positions = lines(1, numbers, grains.position + noise, grains.radius, 0, mark=",")
listed = lines(1, contacts.pair + 1, along, parts(packing)[0], mark=",")
with tempfile.TemporaryDirectory() as folder:
    (Path(folder) / "particle_positions.txt").write_text(positions)
    (Path(folder) / "Adjacency_list.txt").write_text(listed)
    run = gf.read(folder, cell=box(packing), periodic="xy")
    state = run.frames[0].packing
print("frame,id,x,y,r,edge", *positions.splitlines()[:2], sep="\n")
print("frame,id1,id2,tangential,normal", *listed.splitlines()[:2], sep="\n")

# %%
# z is exact, since contacts are listed. a and q/p may be off by 0.02: normals are those between
# the noisy centres.

found = gf.measure(state, criterion="listed", z_definition="z")
assert compared(found, counted(packing)) < 0.02

# %%
# The packing that was read; lines are as wide as the normal force.

figure = plots.network(state, criterion="listed").figure
