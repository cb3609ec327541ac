"""
RigidLibrary: a simulation folder
=================================

Disks in a Lees–Edwards box about the origin. A folder holds ``PosVel<k>.dat`` and
``Contact<k>.dat`` for every snapshot k, the radii in ``posinit.dat`` and the box in
``Parameters_final.dat``. Grains keep their numbers, so granufab's balance can follow every
contact. See :doc:`/formats` and :doc:`/balance`.
"""

import tempfile
from pathlib import Path

import numpy as np
from shared_packing import compared, counted, disks, edges, lines

import granufab as gf
from granufab import plots

packing = disks(seed=15)

# %%
# Write the four files, read the folder. The tangential force acts against (−n_y, n_x).

grains, contacts, size = packing.grains, packing.contacts, edges(packing)
tangent = np.column_stack([-contacts.normal[:, 1], contacts.normal[:, 0]])
push = np.einsum("ci,ci->c", contacts.force, contacts.normal)
along = np.einsum("ci,ci->c", contacts.force, tangent)
touching = np.bincount(contacts.pair.ravel(), minlength=grains.count)
texts = {
    "posinit.dat": lines(np.arange(grains.count), "0 0", grains.radius),
    "PosVel1.dat": lines(grains.position - 0.5 * size, "0 0 0 0", touching),
    "Contact1.dat": lines(contacts.pair, contacts.normal, 0, push, -along, 0),
    "Parameters_final.dat": f"np {grains.count}\nboxVec1x {size[0]:.12g}\nboxVec2y {size[1]:.12g}\n"
    "BCtype Periodic_Edwards\nmu 0.4\n",
}
with tempfile.TemporaryDirectory() as folder:
    for name, text in texts.items():
        (Path(folder) / name).write_text(text)
    run = gf.read(folder)
    state = run.frames[0].packing
print(*run.frames.summary.lines(), sep="\n")

# %%
# z, a and q/p must be those that numpy counts in the packing; twelve digits were written.

found = gf.measure(state, z_definition="z")
assert compared(found, counted(packing)) < 1e-8

# %%
# How much of the friction the contacts that were read mobilise, at µ = 0.4.

figure = plots.mobilisation(gf.fabric.force_statistics(state, friction=0.4)).figure
