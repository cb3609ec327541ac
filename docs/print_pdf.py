"""Print the documentation on one page as PDF, with a Chromium that is installed.

python docs/print_pdf.py build/single/index.html build/granufab.pdf
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

__all__ = ["browser", "print_page"]

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
LONGEST = 300
"""Seconds that printing may take."""


def browser() -> str:
    """Path of the first browser found on PATH.

    Raises:
        SystemExit: there is none.
    """
    for name in BROWSERS:
        found = shutil.which(name)
        if found:
            return found
    raise SystemExit(f"printing the PDF needs one of {', '.join(BROWSERS)} on PATH")


def print_page(page: Path, target: Path) -> None:
    """Print a page of the disk; no network is used.

    Raises:
        SystemExit: there is no browser or no page, or the browser did not write a PDF.
    """
    program = browser()
    if not page.is_file():
        raise SystemExit(f"{page} is missing: run make pdf")
    target.parent.mkdir(parents=True, exist_ok=True)
    target.unlink(missing_ok=True)
    # Chromium refuses its sandbox to root, as in most containers; the page is our own.
    sandbox = ["--no-sandbox"] if getattr(os, "geteuid", lambda: 1)() == 0 else []
    with tempfile.TemporaryDirectory() as profile:
        done = subprocess.run(
            [
                *(program, "--headless", "--disable-gpu", *sandbox),
                *("--no-pdf-header-footer", "--generate-pdf-document-outline"),
                f"--user-data-dir={profile}",
                f"--print-to-pdf={target.resolve()}",
                page.resolve().as_uri(),
            ],
            capture_output=True,
            text=True,
            timeout=LONGEST,
            check=False,
        )
    if not target.exists() or not target.read_bytes().startswith(b"%PDF-"):
        last = (done.stderr.strip() or "nothing was said").splitlines()[-1]
        raise SystemExit(f"{program} wrote no PDF: {last}")


if __name__ == "__main__":
    print_page(Path(sys.argv[1]), Path(sys.argv[2]))
    print(f"wrote {sys.argv[2]}")
