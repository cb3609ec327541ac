"""The folder of a campaign: which files it holds, and what a case's folder tells."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from granufab.campaign.expansion import Member
from granufab.campaign.identity import case_digest
from granufab.errors import GranufabError, InvalidSettings, MissingData
from granufab.io import write_json
from granufab.reproduce.checkpoints import CHECKPOINT
from granufab.simulate.settings import load_case

__all__ = ["CampaignFolder", "State", "is_finished", "seconds_of_run", "state_of_folder"]

State = Literal["waiting", "running", "done", "failed", "interrupted"]


@dataclass(frozen=True, slots=True)
class CampaignFolder:
    """Where the parts of a campaign lie.

    Attributes:
        path: the folder.
    """

    path: Path

    @property
    def table(self) -> Path:
        """State of each case."""
        return self.path / "cases.csv"

    @property
    def notes(self) -> Path:
        """What the campaign is: its parameters and the exact values of each case."""
        return self.path / "campaign.json"

    @property
    def summary(self) -> Path:
        """Counts and times of the last command."""
        return self.path / "summary.json"

    @property
    def results(self) -> Path:
        """The gathered results."""
        return self.path / "results.nc"

    @property
    def manifest(self) -> Path:
        """One line per case, for job arrays."""
        return self.path / "manifest.csv"

    def case(self, identifier: str) -> Path:
        """Folder of a case."""
        return self.path / "cases" / identifier

    def write_notes(self, name: str, keys: dict[str, str], members: Iterable[Member]) -> None:
        """Leave what :func:`granufab.campaign.gather` needs."""
        cases = {m.id: {"seed": m.seed, "parameters": dict(m.parameters)} for m in members}
        write_json({"name": name, "parameters": keys, "cases": cases}, self.notes)

    def read_notes(self) -> dict[str, Any]:
        """What :meth:`write_notes` left.

        Raises:
            MissingData: the folder holds no campaign.
            InvalidSettings: its notes are damaged.
        """
        try:
            notes = json.loads(self.notes.read_text(encoding="utf-8"))
        except OSError:
            raise MissingData(
                f"{self.path}: holds no campaign (no campaign.json); "
                "granufab sweep SWEEP.toml --out DIR makes one"
            ) from None
        except ValueError as error:
            raise InvalidSettings(
                f"{self.notes}: is damaged ({error}); run the sweep again"
            ) from None
        if not isinstance(notes, dict) or not {"name", "parameters", "cases"} <= set(notes):
            raise InvalidSettings(f"{self.notes}: is damaged; run the sweep again")
        return notes


def is_finished(folder: Path, digest: str) -> bool:
    """Whether a case's folder holds a run that came to its end with the settings of ``digest``."""
    try:
        summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        if summary.get("interrupted") or not (folder / "run.h5").exists():
            return False
        return case_digest(load_case(folder / "settings.toml")) == digest
    except (OSError, ValueError, AttributeError, GranufabError):
        return False


def seconds_of_run(folder: Path) -> float:
    """Wall time of a finished run, as its summary tells."""
    try:
        summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        return float(summary["seconds"])
    except (OSError, ValueError, KeyError, TypeError):
        return 0.0


def state_of_folder(folder: Path, digest: str) -> tuple[State, str]:
    """State of a case and the reason, as its folder tells them."""
    if is_finished(folder, digest):
        return "done", ""
    code, reason = _job(folder)
    if code in (1, 2):
        return "failed", reason
    begun = any((folder / name).exists() for name in ("run.h5", CHECKPOINT))
    return ("interrupted" if begun else "waiting"), ""


def _job(folder: Path) -> tuple[int | None, str]:
    """Exit code and last words of a cluster job, see :mod:`granufab.campaign.manifest`."""
    try:
        code = int((folder / "job.code").read_text(encoding="utf-8"))
        words = (folder / "job.log").read_text(encoding="utf-8", errors="replace").split("\n")
    except (OSError, ValueError):
        return None, ""
    last = next((line for line in reversed(words) if line.strip()), f"exit code {code}")
    return code, " ".join(last.removeprefix("granufab:").split())
