"""Rows of numbers in text, read from its bytes.

A number of at most 2⁵³ with a power of ten up to 22 is one exact operation on exact doubles, so
it rounds as the language's own reading does; every other word is left to that, by its place.
"""

from __future__ import annotations

import numpy as np

from granufab.kernels.options import inlined, kernel

__all__ = ["parse_rows"]

_POWERS = np.array([float(f"1e{k}") for k in range(23)])
_EXACT = 2**53
_SPACE, _NEWLINE, _RETURN, _TAB = 32, 10, 13, 9
_ZERO, _NINE, _POINT, _PLUS, _MINUS = 48, 57, 46, 43, 45


@inlined
def _blank(byte):
    return byte in (_SPACE, _TAB, _RETURN)


@inlined
def _is_exponent(byte):
    return byte in (101, 69, 100, 68)  # e E d D


@inlined
def _whole(text, start, stop):
    """Digits as a whole number, with a sign: (value, understood)."""
    sign = 1
    if start < stop and (text[start] == _PLUS or text[start] == _MINUS):
        sign = -1 if text[start] == _MINUS else 1
        start += 1
    if start == stop or stop - start > 6:
        return 0, False
    value = 0
    for k in range(start, stop):
        if not _ZERO <= text[k] <= _NINE:
            return 0, False
        value = 10 * value + (int(text[k]) - _ZERO)
    return sign * value, True


@inlined
def _number(text, start, stop):
    """The number of a word: (value, exact)."""
    negative = text[start] == _MINUS
    k = start + 1 if negative or text[start] == _PLUS else start
    mantissa, digits, shift, point = 0, 0, 0, False
    while k < stop and not _is_exponent(text[k]):
        if text[k] == _POINT and not point:
            point = True
        elif _ZERO <= text[k] <= _NINE and mantissa < _EXACT:
            mantissa = 10 * mantissa + (int(text[k]) - _ZERO)
            digits += 1
            shift -= 1 if point else 0
        else:
            return 0.0, False
        k += 1
    if digits == 0 or mantissa > _EXACT:
        return 0.0, False
    if k < stop:
        power, understood = _whole(text, k + 1, stop)
        if not understood:
            return 0.0, False
        shift += power
    if not -22 <= shift <= 22:
        return 0.0, False
    size = mantissa * _POWERS[shift] if shift >= 0 else mantissa / _POWERS[-shift]
    return (-size if negative else size), True


@kernel
def parse_rows(text, columns, slot, out, late):
    """Read whole lines until the text, the rows or the places for late words end.

    Args:
        text: bytes that end at the end of a line, uint8, shape (length,).
        columns: words that every line must have.
        slot: column of ``out`` for each word of a line, −1 for those not wanted, shape (columns,).
        out: rows of numbers, filled, shape (row_count, wanted).
        late: row, column of ``out``, first and last byte + 1 of every word that is left to the
            caller, filled, shape (late_count, 4); at least as long as ``out`` is wide.
    Returns:
        Rows read, bytes read, late words, and the words of the line where another number of
        them was found (−1: none was).
    """
    row, at, lates, length = 0, 0, 0, len(text)
    while at < length and row < len(out) and lates + out.shape[1] <= len(late):
        begin, word = at, 0
        while at < length and text[at] != _NEWLINE:
            if _blank(text[at]):
                at += 1
                continue
            start = at
            while at < length and text[at] != _NEWLINE and not _blank(text[at]):
                at += 1
            if word < columns and slot[word] >= 0:
                value, exact = _number(text, start, at)
                out[row, slot[word]] = value
                if not exact:
                    late[lates, 0], late[lates, 1] = row, slot[word]
                    late[lates, 2], late[lates, 3] = start, at
                    lates += 1
            word += 1
        at += 1
        if word != columns:
            return row, begin, lates, word
        row += 1
    return row, at, lates, -1
