"""
MercuryDPM: a restart file
==========================

A restart file is complete: grains, periodic boundaries and interactions, each line made of names
and values. Forces are those on the first particle. See :doc:`/formats`.
"""

import tempfile
from pathlib import Path

import numpy as np
from shared_packing import compared, counted, edges, lines, points, spheres

import granufab as gf
from granufab import plots

packing = spheres(seed=13)

# %%
# Write the file, read it, and look at its head.

grains, contacts = packing.grains, packing.contacts
limits = zip("xyz", edges(packing), strict=True)
text = "MercuryDPM 1.0 name shear\n"
text += " ".join(f"{axis}Min 0 {axis}Max {edge:.12g}" for axis, edge in limits) + "\n"
text += f"timeStep 0.1 time {packing.time} ntimeSteps 25 timeMax 9\n"
text += "systemDimensions 3 particleDimensions 3\nBoundaries 3\n"
for axis, edge in enumerate(edges(packing)):
    unit, shift = np.eye(3)[axis], edge * np.eye(3)[axis]
    text += f"PeriodicBoundary id {axis} normal {unit[0]:g} {unit[1]:g} {unit[2]:g} "
    text += f"distanceLeft 0 distanceRight {edge:.12g} shift {lines(shift[None])}"
text += f"Particles {grains.count}\n" + lines(
    "BaseParticle id", np.arange(grains.count), "position", grains.position,
    "velocity 0 0 0 angularVelocity 0 0 0 radius", grains.radius, "invMass", 1 / grains.mass,
)  # fmt: skip
text += f"Interactions {contacts.count}\n" + lines(
    "FrictionInteraction particleIds", contacts.pair, "timeStamp 25 contactPoint",
    points(packing), "force", -contacts.force, "torque 0 0 0",
)  # fmt: skip
with tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / "shear.restart"
    path.write_text(text)
    run = gf.read(path)
    state = run.frames[0].packing
print(*text.splitlines()[:6], sep="\n")

# %%
# z, a and q/p must be those that numpy counts in the packing; twelve digits were written.

found = gf.measure(state, z_definition="z")
assert compared(found, counted(packing)) < 1e-8

# %%
# The contacts that were read, as lines as wide as their normal force; what is farther is paler.

figure = plots.network_3d(state).figure
