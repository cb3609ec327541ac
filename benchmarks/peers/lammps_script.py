"""The job as LAMMPS input: a data file of the common sample and a script."""

from __future__ import annotations

import math
from dataclasses import dataclass

from biaxial_job import Job, Start

STEP_SHARE = 0.15
"""Time step over √(m_min/k_n): about 1/15 of the time two grains collide."""
RESTITUTION_DAMPING = 0.45
"""Damping ratio ζ of a binary collision (restitution about 0.2)."""
CELL_PERIOD = 20.0
"""Response time of the barostat [√(<m>/σ)]."""
REST_TIME = 200.0
"""Time given to the contacts to take up the pressure before the shear [√(<m>/σ)]."""
SKIN = 0.3

CONTACTS, LOG, DATA, SCRIPT = "contacts.dump", "lammps.log", "start.data", "in.biaxial"


@dataclass(frozen=True, slots=True, kw_only=True)
class Schedule:
    """Step sizes and counts of one run.

    Attributes:
        step: time step [s].
        rest: steps of rest.
        every: steps between measured states.
        shear: steps of shear, a multiple of ``every``.
    """

    step: float
    rest: int
    every: int
    shear: int

    @classmethod
    def of(cls, job: Job, start: Start, kappa: float) -> Schedule:
        """Schedule of a job at k_n/σ = ``kappa``."""
        wanted = STEP_SHARE * math.sqrt(float(start.mass.min()) / kappa)
        duration = job.strain / start.axial_rate(job)
        every = math.ceil(duration / wanted / job.states)
        step = duration / (every * job.states)
        rest = math.ceil(REST_TIME * math.sqrt(float(start.mass.mean())) / step)
        return cls(step=step, rest=rest, every=every, shear=every * job.states)


def data_text(start: Start) -> str:
    """The sample as a LAMMPS data file, atom style sphere (in 2D: disks of density 1/π)."""
    head = [
        "dense frictionless sample of disks",
        "",
        f"{len(start.radius)} atoms",
        "1 atom types",
        f"0 {start.sides[0]:.15g} xlo xhi",
        f"0 {start.sides[1]:.15g} ylo yhi",
        "-0.5 0.5 zlo zhi",
        "",
        "Atoms # sphere",
        "",
    ]
    atoms = [
        f"{k} 1 {2 * radius:.15g} {1 / math.pi:.15g} {x:.15g} {y:.15g} 0"
        for k, ((x, y), radius) in enumerate(zip(start.position, start.radius, strict=True), 1)
    ]
    return "\n".join(head + atoms) + "\n"


def pair_commands(kappa: float, friction: float, tangential: float) -> str:
    """Linear springs k_n, k_t = ``tangential``·k_n with damping and Coulomb friction."""
    damping = 2 * RESTITUTION_DAMPING * math.sqrt(kappa / 0.5)  # reduced mass of two mean disks
    return (
        f"pair_style gran/hooke/history {kappa:.10g} {tangential * kappa:.10g} "
        f"{damping:.10g} NULL {friction:g} 1\npair_coeff * *"
    )


def script_text(job: Job, start: Start, kappa: float, tangential: float = 1.0) -> str:
    """Rest at σ = 1 without friction, then the biaxial compression.

    Args:
        job: strain, rate, friction.
        start: the sample, for masses.
        kappa: k_n/σ; the tangential spring is ``tangential`` times it.
    """
    plan = Schedule.of(job, start, kappa)
    barostat = f"{CELL_PERIOD:g} drag 2.0 ptemp 1.0 disc"
    return f"""\
dimension 2
units lj
atom_style sphere
boundary p p p
newton off
comm_modify vel yes
read_data {DATA}
set group all density/disc {1 / math.pi:.15g}
neighbor {SKIN:g} bin
neigh_modify every 1 delay 0 check yes
timestep {plan.step:.12g}
{pair_commands(kappa, 0.0, tangential)}
fix flat all enforce2d
thermo_style custom step pxx pyy lx ly ke
thermo {plan.rest}
fix move all nph/sphere iso 1.0 1.0 {barostat}
run {plan.rest}
unfix move
reset_timestep 0
{pair_commands(kappa, job.friction, tangential)}
fix move all nph/sphere x 1.0 1.0 {barostat}
fix press all deform 1 y trate {-start.axial_rate(job):.12g} remap x
compute ids all property/local patom1 patom2 cutoff radius
compute touch all pair/local dx dy force cutoff radius
dump list all local {plan.every} {CONTACTS} c_ids[1] c_ids[2] c_touch[1] c_touch[2] c_touch[3]
thermo {plan.every}
print "shear begins"
run {plan.shear}
"""
