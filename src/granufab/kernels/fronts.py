"""Dense fronts of a sparse elimination."""

from __future__ import annotations

from granufab.kernels.options import kernel

__all__ = ["add_lower"]


@kernel
def add_lower(block, at, addition):
    """block[at, at] += addition in the lower triangles; ``at`` is increasing."""
    for column in range(len(at)):
        for row in range(column, len(at)):
            block[at[row], at[column]] += addition[row, column]
