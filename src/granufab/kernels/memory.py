"""New arrays inside kernels: numba's own take longer to compile than what is done with them."""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.imputils import impl_ret_new_ref
from numba.extending import lower_builtin, type_callable
from numba.np.arrayobj import populate_array

__all__ = ["empty", "unlinked", "zeros"]

_ALIGNMENT = 64


def empty(shape: tuple[int, ...], dtype: Any) -> Any:
    """Array of a shape, a tuple; its numbers are to be written before they are read."""
    return np.empty(shape, dtype)


def zeros(shape: tuple[int, ...], dtype: Any) -> Any:
    """Array of zeros; its shape is a tuple."""
    return np.zeros(shape, dtype)


def unlinked(shape: tuple[int, ...], dtype: Any) -> Any:
    """Array of integers that name nothing: −1 everywhere; its shape is a tuple."""
    return np.full(shape, -1, dtype)


def _register(function: Any, fill: int | None) -> None:
    @type_callable(function)
    def typing(context):
        def kind(shape, dtype):
            return types.Array(dtype.dtype, shape.count, "C")

        return kind

    @lower_builtin(function, types.BaseTuple, types.Any)
    def code(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        kind = signature.return_type
        shape = [
            context.cast(builder, size, of, types.intp)
            for size, of in zip(
                cgutils.unpack_tuple(builder, values[0]), signature.args[0], strict=True
            )
        ]
        return _allocate(context, builder, kind, shape, fill)


def _allocate(context: Any, builder: Any, kind: Any, shape: list[Any], fill: int | None) -> Any:
    numbers = context.get_data_type(kind.dtype)
    itemsize = context.get_constant(types.intp, context.get_abi_sizeof(numbers))
    strides = [itemsize]
    for size in reversed(shape):
        strides.insert(0, builder.mul(strides[0], size))
    memory = context.nrt.meminfo_alloc_aligned(builder, strides[0], _ALIGNMENT)
    data = context.nrt.meminfo_data(builder, memory)
    if fill is not None:
        cgutils.memset(builder, data, strides[0], ir.Constant(ir.IntType(8), fill))
    array = context.make_array(kind)(context, builder)
    populate_array(
        array,
        data=builder.bitcast(data, numbers.as_pointer()),
        shape=tuple(shape),
        strides=tuple(strides[1:]),
        itemsize=itemsize,
        meminfo=memory,
    )
    return impl_ret_new_ref(context, builder, kind, array._getvalue())


for _function, _fill in ((empty, None), (zeros, 0), (unlinked, 255)):
    _register(_function, _fill)
