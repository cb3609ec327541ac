"""Command line of granufab: ``main`` turns every expected failure into one line and a code.

Exit codes: 0 done, 1 a run failed, 2 bad input or usage, 3 interrupted. Verbs import what they
compute with when they are called, so that ``granufab --help`` answers at once.
"""

from __future__ import annotations

import errno
import os
import signal
import sys
import warnings
from collections.abc import Callable, Sequence
from typing import Any

from granufab.cli.application import app
from granufab.cli.interruption import watch_signals
from granufab.errors import (
    CorruptFile,
    GranufabError,
    IncompleteFile,
    InvalidPacking,
    InvalidSettings,
    MissingData,
    UnknownFormat,
)

__all__ = ["app", "main"]

DONE, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 3
_BAD_INPUT = (InvalidSettings, MissingData, UnknownFormat, CorruptFile, InvalidPacking)
_BAD_PATH = {
    errno.EACCES,
    errno.EEXIST,
    errno.EISDIR,
    errno.ENAMETOOLONG,
    errno.ENOENT,
    errno.ENOTDIR,
    errno.EPERM,
    errno.EROFS,
}


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit the process with its code."""
    with watch_signals(), warnings.catch_warnings():
        warnings.showwarning = _shown(warnings.showwarning)
        code = _exit_code(arguments)
    sys.exit(code)


def _shown(usual: Callable[..., None]) -> Callable[..., None]:
    """Show warnings about files in one line, others as usual."""

    def show(message: Warning | str, category: type[Warning], *place: Any, **more: Any) -> None:
        if issubclass(category, IncompleteFile):
            print("granufab: warning:", " ".join(str(message).split()), file=sys.stderr)
        else:
            usual(message, category, *place, **more)

    return show


def _exit_code(arguments: Sequence[str] | None) -> int:
    try:
        code = app(args=arguments, prog_name="granufab", standalone_mode=False)
        sys.stdout.flush()
    except KeyboardInterrupt:
        return _fail("interrupted", INTERRUPTED)
    except GranufabError as error:
        return _fail(str(error), BAD_INPUT if isinstance(error, _BAD_INPUT) else FAILED)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return FAILED
    except OSError as error:
        return _fail(_describe(error), BAD_INPUT if error.errno in _BAD_PATH else FAILED)
    except MemoryError as error:
        return _fail(f"not enough memory {error}".rstrip(), FAILED)
    except Exception as error:
        if not hasattr(error, "format_message"):  # not a usage error: a defect, show where
            raise
        return _usage(error)
    if code == 128 + signal.SIGINT:  # the parser's word for Ctrl-C
        return _fail("interrupted", INTERRUPTED)
    return code if isinstance(code, int) else DONE


def _fail(message: str, code: int) -> int:
    print("granufab:", " ".join(message.split()), file=sys.stderr)
    return code


def _usage(error: Any) -> int:
    context = getattr(error, "ctx", None)
    path = getattr(context, "command_path", None) or "granufab"
    return _fail(f"{error.format_message()} (see {path} --help)", BAD_INPUT)


def _describe(error: OSError) -> str:
    if error.filename is None:
        return str(error)
    return f"{error.filename}: {error.strerror or error}"
