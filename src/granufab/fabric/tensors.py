"""Fabric tensors and the anisotropies read from them, with their noise floors.

Sources: [Radjai2012], eqs. 1–5, 12, 13. In 3D the signed anisotropy is
a' = (5/4)<3 (n·d)² − 1>; the printed form lacks a factor 1/2.
"""

from __future__ import annotations

import math
from typing import TypeVar

import numpy as np

from granufab.errors import MissingData
from granufab.packing import Array, Contacts

__all__ = [
    "anisotropy",
    "anisotropy_bias",
    "anisotropy_noise",
    "axial_anisotropy",
    "deviatoric_part",
    "enriched_tensor",
    "fabric_tensor",
    "fourth_order_tensor",
    "intermediate_ratio",
    "major_angle",
    "major_direction",
    "mean_part",
    "principal_values",
    "signed_anisotropy",
]


T = TypeVar("T", float, Array)


def fabric_tensor(contacts: Contacts | Array) -> Array:
    r"""Mean of n⊗n over the contacts, :math:`F_{ij} = N_c^{-1}\sum_c n_i n_j` [Radjai2012, §2].

    Args:
        contacts: contacts, or their normals alone [-], shape (contact_count, D).
    Returns:
        Symmetric, trace 1 [-], shape (D, D).
    Raises:
        MissingData: there are no contacts.
    """
    normal = _normals(contacts)
    return normal.T @ normal / len(normal)


def enriched_tensor(fabric: Array, z: float) -> Array:
    r"""Fabric per grain, :math:`G = (z/2) F` [Radjai2012, eq. 1]; its trace is z/2.

    Args:
        fabric: fabric tensor F over the contacts that ``z`` counts [-], shape (D, D).
        z: coordination number in use [-].
    Returns:
        Symmetric [-], shape (D, D).
    """
    return 0.5 * z * np.asarray(fabric)


def fourth_order_tensor(contacts: Contacts | Array) -> Array:
    r"""Mean of n⊗n⊗n⊗n over the contacts [-], shape (D, D, D, D); its double trace is 1.

    Args:
        contacts: contacts, or their normals alone [-], shape (contact_count, D).
    Raises:
        MissingData: there are no contacts.
    """
    normal = _normals(contacts)
    dimension = normal.shape[1]
    dyad = np.einsum("ci,cj->cij", normal, normal).reshape(len(normal), -1)
    return (dyad.T @ dyad / len(normal)).reshape((dimension,) * 4)


def principal_values(tensor: Array) -> Array:
    """Eigenvalues of the symmetric part, largest first, shape (D,)."""
    tensor = np.asarray(tensor)
    return np.asarray(np.linalg.eigvalsh(0.5 * (tensor + tensor.T))[::-1], dtype=np.float64)


def mean_part(tensor: Array) -> float:
    """p = tr/D, of G [Radjai2012, eqs. 2, 4: z/4 in 2D, z/6 in 3D] or of a stress."""
    return float(np.trace(tensor)) / len(tensor)


def deviatoric_part(tensor: Array) -> float:
    """q = (T_1 − T_2)/2 in 2D, (T_1 − T_3)/3 in 3D, ≥ 0 [Radjai2012, eqs. 3, 5]."""
    values = principal_values(tensor)
    return float(values[0] - values[-1]) / len(values)


def anisotropy(fabric: Array) -> float:
    """Unsigned anisotropy a = 2(F_1 − F_2) in 2D, (5/2)(F_1 − F_3) in 3D [-].

    Noise only adds to it (:func:`anisotropy_bias`): use :func:`signed_anisotropy` on paths.
    [Radjai2012, eqs. 12, 13], the 3D form without the assumption of axial symmetry.

    Args:
        fabric: fabric tensor, shape (D, D).
    """
    values = principal_values(fabric)
    return (2.0 if len(values) == 2 else 2.5) * float(values[0] - values[-1])


def signed_anisotropy(fabric: Array, direction: Array, *, minor: Array | None = None) -> float:
    r"""Anisotropy along a fixed direction d [-], negative where contacts avoid d.

    2D: :math:`a' = 2\langle\cos 2(\theta-\theta_0)\rangle = 2(2\,d\cdot F\cdot d - 1)`;
    3D, about an axis of symmetry: :math:`a' = \frac54\langle 3(n\cdot d)^2 - 1\rangle`. With a
    second axis e, for true triaxial states: 2(d·F·d − e·F·e) in 2D, (5/2)(d·F·d − e·F·e) in 3D,
    which is the unsigned a where d and e are the major and the minor principal direction.

    Args:
        fabric: fabric tensor, shape (D, D).
        direction: the loading's symmetry axis, or that of largest contraction, of any length,
            shape (D,).
        minor: the loading's axis of least contraction, of any length, shape (D,).
    """
    along = _along(fabric, direction)
    if minor is not None:
        return (2.0 if len(fabric) == 2 else 2.5) * (along - _along(fabric, minor))
    return axial_anisotropy(along, len(fabric))


def axial_anisotropy(square: T, dimension: int) -> T:
    """a' from the mean of (n·d)²: 2(2<(n·d)²> − 1) in 2D, (5/4)(3<(n·d)²> − 1) in 3D [-].

    Args:
        square: <(n·d)²> [-]; of a single contact, its term of the mean.
        dimension: 2 or 3.
    """
    return 2.0 * (2.0 * square - 1.0) if dimension == 2 else 1.25 * (3.0 * square - 1.0)


def _along(tensor: Array, direction: Array) -> float:
    """Value of a tensor along a direction of any length."""
    direction = np.asarray(direction, dtype=float)
    return float(direction @ tensor @ direction) / float(direction @ direction)


def major_angle(fabric: Array) -> float:
    """Major direction θ_c of a 2D tensor, in degrees from the x axis, in [0, 180)."""
    angle = math.degrees(0.5 * math.atan2(2.0 * fabric[0, 1], fabric[0, 0] - fabric[1, 1]))
    angle = angle + 180.0 if angle < 0 else angle
    return 0.0 if angle >= 180.0 else angle


def major_direction(fabric: Array) -> Array:
    """Unit vector along the largest principal value [-], shape (D,).

    Its largest component is positive, since n and −n are the same direction.
    """
    vector = np.linalg.eigh(np.asarray(fabric))[1][:, -1]
    return vector * np.sign(vector[np.argmax(np.abs(vector))])


def intermediate_ratio(tensor: Array) -> float:
    """b_G = (G_2 − G_3)/(G_1 − G_3) of a 3D tensor [-]: 0 in compression, 1 in extension.

    Raises:
        MissingData: the tensor is not 3D, or isotropic, so that b has no meaning.
    """
    values = principal_values(tensor)
    if len(values) != 3 or values[0] - values[2] <= 1e-14 * abs(values[0]):
        raise MissingData("b_G has no meaning: it needs an anisotropic tensor in 3D")
    return float((values[1] - values[2]) / (values[0] - values[2]))


def anisotropy_noise(contact_count: int, dimension: int, a: float = 0.0) -> float:
    """Standard error of the signed anisotropy if contacts were independent [-].

    √((2 − a²)/N_c) in 2D, √((5/4 + 5a/7 − a²)/N_c) in 3D, for a second-order P_n. Neighbours
    of a grain repel each other, so that a dense packing has less: this is an upper mark.

    Args:
        contact_count: number of contacts.
        dimension: 2 or 3.
        a: true signed anisotropy [-].
    Raises:
        MissingData: there are no contacts.
    """
    _check_count(contact_count)
    variance = 2.0 - a * a if dimension == 2 else 1.25 + 5.0 * a / 7.0 - a * a
    return math.sqrt(max(variance, 0.0) / contact_count)


def anisotropy_bias(contact_count: int, dimension: int) -> float:
    """Mean of the unsigned anisotropy of an isotropic state, contacts independent [-].

    √(π/N_c) in 2D; 2.69/√N_c in 3D (the mean spread of the random traceless tensor).

    Args:
        contact_count: number of contacts.
        dimension: 2 or 3.
    Raises:
        MissingData: there are no contacts.
    """
    _check_count(contact_count)
    return (math.sqrt(math.pi) if dimension == 2 else 2.69) / math.sqrt(contact_count)


def _check_count(contact_count: int) -> None:
    if contact_count < 1:
        raise MissingData("there are no contacts, so the fabric is not defined")


def _normals(contacts: Contacts | Array) -> Array:
    normal = contacts.normal if isinstance(contacts, Contacts) else np.asarray(contacts)
    _check_count(len(normal))
    return normal
