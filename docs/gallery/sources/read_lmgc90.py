"""
LMGC90: BODIES.DAT, DOF and Vloc_Rloc
=====================================

LMGC90 describes the bodies once (``BODIES.DAT``), their displacements in ``DOF`` and the contacts
in ``Vloc_Rloc`` files, all in records of Fortran. Listed contacts are candidates, of which the
criterion ``force`` counts those that bear. The periodic cell is not in the files; ``cell=`` gives
it. LMGC90 is a Contact Dynamics program like granufab; see :doc:`/formats` for its files.
"""

import tempfile
from pathlib import Path

import numpy as np
from shared_bodies import bodies, fortran
from shared_packing import box, compared, counted, disks

import granufab as gf
from granufab import plots

packing = disks(seed=10)

# %%
# Write the three files, read their folder, and look at the record of one contact.

grains, contacts = packing.grains, packing.contacts
normal = contacts.normal  # from the antagonist, the first grain, to the candidate
tangent = np.column_stack([normal[:, 1], -normal[:, 0]])
push = np.einsum("ci,ci->c", contacts.force, normal)
along = np.einsum("ci,ci->c", contacts.force, tangent)

head = f"$steps {1:8d}              time={fortran(packing.time)}\n \n!-----\n"
dof = "     \n! DOF\n     \n" + head
for k in range(grains.count):
    zero = "  ".join(f"X({i})={fortran(0)}" for i in (1, 2, 3))
    dof += f"$bdyty\n RBDY2  {k + 1:5d}\n$nodty\n NO3xx      1                {zero}\n"
    dof += zero.replace("X", "V") + "\n$$$$$$\n"
listed = "     \n! Vloc_Rloc\n      \n" + head
for c, (i, j) in enumerate(contacts.pair + 1):
    listed += (
        f"$icdan  DKDKx {c + 1:8d}\n cdbdy  numbr  cdtac  numbr  behav  anbdy  numbr\n"
        f" RBDY2  {j:5d}  DISKx      1  rstc1  RBDY2  {i:5d}  DISKx      1  slibw    154\n"
        f"      rlt/H{fortran(along[c])}  rln/H{fortran(push[c])}  rls/H{fortran(0)}\n"
        f"      vlt ={fortran(0)}  vln ={fortran(0)}  vls ={fortran(0)}\n"
        f"      gapTT{fortran(contacts.gap[c])}\n"
        f"      n(1)={fortran(normal[c, 0])}  n(2)={fortran(normal[c, 1])}  n(3)={fortran(0)}\n"
        f"      coo1={fortran(0)}  coo2={fortran(0)}  coo3={fortran(0)}\n \n"
    )
with tempfile.TemporaryDirectory() as folder:
    (Path(folder) / "BODIES.DAT").write_text(bodies(packing))
    (Path(folder) / "DOF.INI").write_text(dof + "!-----\n")
    (Path(folder) / "Vloc_Rloc.INI").write_text(listed)
    run = gf.read(folder, cell=box(packing), periodic="xy")
    state = run.frames[0].packing
print(*listed.splitlines()[6:15], sep="\n")

# %%
# z, a and q/p must be those that numpy counts in the packing; eight digits were written.

found = gf.measure(state, z_definition="z")
assert compared(found, counted(packing)) < 1e-5

# %%
# The packing that was read; lines are as wide as the normal force.

figure = plots.network(state).figure
