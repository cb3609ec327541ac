"""Settings every test needs before numba, numpy and matplotlib are first imported."""

from __future__ import annotations

import hashlib
import os
import tempfile
from pathlib import Path

os.environ.setdefault("MPLBACKEND", "Agg")


def _compiled_code_folder() -> Path:
    """A cache folder named by the sources that compiled code depends on.

    Numba keys its disk cache by each file's own time stamp, so a kernel that inlines a function
    from an edited file would be served stale.
    """
    package = Path(__file__).resolve().parent.parent / "src" / "granufab"
    digest = hashlib.sha256()
    for folder in ("kernels", "simulate"):
        for source in sorted((package / folder).rglob("*.py")):
            digest.update(source.relative_to(package).as_posix().encode())
            digest.update(source.read_bytes())
    user = os.environ.get("USER", "user")
    return Path(tempfile.gettempdir()) / f"granufab-{user}-{digest.hexdigest()[:16]}"


os.environ["NUMBA_CACHE_DIR"] = str(_compiled_code_folder())
