"""Contact Dynamics of disks and spheres: samples, loading, stepping, runs."""

from granufab.simulate.loading import Biaxial, ConstantMean, Isotropic, Loading, SimpleShear
from granufab.simulate.local_form import contact_frames, local_form, local_state
from granufab.simulate.local_residual import local_errors
from granufab.simulate.local_solve import solve_local
from granufab.simulate.paths import Kept, Step, run, run_case, shear
from granufab.simulate.preparation import Prepared, compress, prepare
from granufab.simulate.relaxation import HARD, Relaxed, overlaps, pressure_of, relax
from granufab.simulate.sample import draw_radii, random_sample
from granufab.simulate.settings import Case, Material, Record, Sample, Sizes, Solver, Stage
from granufab.simulate.stepping import Simulation

__all__ = [
    "HARD",
    "Biaxial",
    "Case",
    "ConstantMean",
    "Isotropic",
    "Kept",
    "Loading",
    "Material",
    "Prepared",
    "Record",
    "Relaxed",
    "Sample",
    "SimpleShear",
    "Simulation",
    "Sizes",
    "Solver",
    "Stage",
    "Step",
    "compress",
    "contact_frames",
    "draw_radii",
    "local_errors",
    "local_form",
    "local_state",
    "overlaps",
    "prepare",
    "pressure_of",
    "random_sample",
    "relax",
    "run",
    "run_case",
    "shear",
    "solve_local",
]
