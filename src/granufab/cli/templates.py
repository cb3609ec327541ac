"""The cases that ``granufab new`` prints, one per loading."""

from __future__ import annotations

from granufab.simulate.settings import Case, Material, Sample, Stage

__all__ = ["TEMPLATES"]

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
