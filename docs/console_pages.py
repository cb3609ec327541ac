"""Pages whose commands are run; ``python docs/console_pages.py PAGE.md`` writes what they print.

A console block holds commands behind ``$ `` and below each what it prints on standard output; a
line of an ellipsis stands for lines left out, and a command without any is not shown. The tests run
the same blocks and compare.
"""

from __future__ import annotations

import os
import re
import stat
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

__all__ = ["Command", "Shell", "blocks", "commands", "shown"]

LEFT_OUT = "…"


@dataclass(frozen=True)
class Command:
    """One line behind a ``$`` of a console block, and the lines printed below it."""

    line: str
    printed: tuple[str, ...]


def blocks(page: Path, *languages: str) -> list[tuple[str, str]]:
    """Language and text of the fenced blocks of a page, in order."""
    wanted = "|".join(languages)
    text = page.read_text(encoding="utf-8")
    return re.findall(rf"^```({wanted})\n(.*?)^```", text, re.DOTALL | re.MULTILINE)


def commands(block: str) -> Iterator[Command]:
    """The commands of a console block; a line that ends with a backslash goes on in the next."""
    for part in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]:
        line, *printed = part.rstrip("\n").split("\n")
        while line.endswith("\\") and printed:
            line += "\n" + printed.pop(0)
        yield Command(line, tuple(printed))


@dataclass(frozen=True)
class Shell:
    """Runs lines by bash in a folder; ``granufab`` is the package that this Python imports."""

    folder: Path

    def __post_init__(self) -> None:
        tool = self._tools / "granufab"
        if not tool.exists():
            self._tools.mkdir(parents=True, exist_ok=True)
            code = "from granufab.cli import main; main()"
            tool.write_text(f"#!/bin/sh\nexec '{sys.executable}' -c '{code}' \"$@\"\n")
            tool.chmod(tool.stat().st_mode | stat.S_IXUSR)

    @property
    def _tools(self) -> Path:
        return self.folder / ".tools"

    def environment(self) -> dict[str, str]:
        """That of this process, with the package in use first, and one thread."""
        import granufab

        source = str(Path(granufab.__file__).resolve().parents[1])
        found = os.pathsep.join(filter(None, (source, os.environ.get("PYTHONPATH"))))
        programs = (str(self._tools), str(Path(sys.executable).parent), os.environ["PATH"])
        return os.environ | {
            "PATH": os.pathsep.join(programs),
            "PYTHONPATH": found,
            "GRANUFAB_THREADS": "1",
            "MPLBACKEND": "Agg",
        }

    def run(self, line: str, *, code: int = 0) -> str:
        """What a line prints on standard output.

        Raises:
            RuntimeError: it ends with another exit code.
        """
        done = subprocess.run(
            ["bash", "-c", line], cwd=self.folder, env=self.environment(),
            capture_output=True, text=True, timeout=300, check=False,
        )  # fmt: skip
        if done.returncode != code:
            raise RuntimeError(f"{line}\nexit code {done.returncode}\n{done.stdout}{done.stderr}")
        return done.stdout


def shown(printed: str, page: tuple[str, ...]) -> list[str]:
    """Of the lines that a command prints, those that a page shows of it."""
    lines = [line.rstrip() for line in printed.splitlines()]
    if not any(line.strip() for line in page):
        return []
    if LEFT_OUT not in page:
        return lines
    cut = page.index(LEFT_OUT)
    last = len(page) - cut - 1
    return [*lines[:cut], LEFT_OUT, *(lines[-last:] if last else [])]


def _rewritten(page: Path, shell: Shell) -> str:
    def block(found: re.Match[str]) -> str:
        if found[1] != "console":
            shell.run(f"python - <<'END'\n{found[2]}END")
            return found[0]
        lines = []
        for command in commands(found[2]):
            lines += [f"$ {command.line}", *shown(shell.run(command.line), command.printed)]
        return "\n".join(["```console", *lines, "```"])

    text = page.read_text(encoding="utf-8")
    return re.sub(r"^```(console|python)\n(.*?)^```$", block, text, flags=re.DOTALL | re.MULTILINE)


def main() -> None:
    """Rewrite the pages named on the command line."""
    for name in sys.argv[1:]:
        with tempfile.TemporaryDirectory() as folder:
            text = _rewritten(Path(name), Shell(Path(folder)))
        Path(name).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
