"""The cases that ``granufab new`` prints, one per loading, and a campaign."""

from __future__ import annotations

from granufab.simulate.settings import Case, Material, Sample, Stage

__all__ = ["SWEEP", "TEMPLATES"]

TEMPLATES: dict[str, Case] = {
    "isotropic": Case(
        name="isotropic",
        sample=Sample(friction=0.0),
        material=Material(friction=0.0),
        path=(Stage(loading="isotropic", strain=0.01),),
    ),
    "shear": Case(name="shear", path=(Stage(loading="constant-mean", strain=0.3),)),
    "biaxial": Case(name="biaxial", path=(Stage(loading="biaxial", strain=0.3),)),
    "triaxial": Case(
        name="triaxial",
        sample=Sample(dimension=3),
        path=(Stage(loading="triaxial", strain=0.4),),
    ),
    "true-triaxial": Case(
        name="true-triaxial",
        sample=Sample(dimension=3),
        path=(Stage(loading="constant-mean", strain=0.4, b=0.5),),
    ),
    "simple-shear": Case(name="simple-shear", path=(Stage(loading="simple-shear", strain=0.3),)),
    "reversal": Case(
        name="reversal",
        path=(
            Stage(loading="constant-mean", strain=0.3),
            Stage(loading="constant-mean", strain=-0.3),
        ),
    ),
}

SWEEP = """\
name = "friction"  # name of the campaign
seeds = 3  # samples of each point, or their seeds: [1, 2, 5]

[case]  # what every case has: sections as in granufab new shear
# file = "case.toml"  # take them from this file; sections below win over it

[case.sample]
grain_count = 1000  # number of grains

[[case.path]]
loading = "constant-mean"  # which cell components are rate- and stress-driven
strain = 0.3  # deviatoric strain

[[parameter]]  # a list; parameters are combined, each value with each of the others
key = "material.friction"  # setting of the case that is varied
values = [0.1, 0.2, 0.4, 0.8]  # its values

[[parameter]]  # a grid: count values from low to high
key = "path.0.inertial_number"  # of the first stage of the path
name = "rate"  # column and axis; default the last part of the key
low = 1e-4
high = 1e-3
count = 2
spacing = "log"  # or linear

# Lists that carry the same word in zip are walked together:
# [[parameter]]
# key = "sample.coordination"
# values = [3.2, 3.9]
# zip = "start"
#
# A range without count is sampled by a Latin hypercube, together with the others like it:
# [[parameter]]
# key = "material.restitution"
# low = 0.0
# high = 0.9
#
# [latin]
# count = 20  # points
# seed = 1  # random seed of the hypercube
"""
