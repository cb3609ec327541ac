"""What was read from somebody else's data, and what was done to it: for a person and a program."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

__all__ = ["ImportSummary"]

_SUMS = (
    "frames_read", "walls_dropped", "wall_contacts_dropped", "duplicates_dropped",
    "self_contacts_dropped",
)  # fmt: skip
_LATEST = ("grains", "contacts", "rattlers", "round_grains")
_SHOWN = 5
"""Skipped frames whose reasons are shown to a person; a program gets all of them."""


def _many(count: int, what: str) -> str:
    """A number of things, in the plural where it is not one."""
    return f"{count} {what}" + ("" if count == 1 else "s")


@dataclass(slots=True, kw_only=True)
class ImportSummary:
    """Counts and conventions, filled while frames are read.

    Attributes:
        format: name of the format.
        files: read.
        frames: in the series; frames_read of them were read so far, empty_frames had no grains.
        grains, contacts: of the frame read last.
        walls_dropped, wall_contacts_dropped, duplicates_dropped, self_contacts_dropped: of all
            frames read.
        rattlers: of the frame read last, as z_backbone counts them, or None.
        round_grains: False where grains are neither disks nor spheres.
        skipped_frames: number and reason of frames that could not be read and were left out.
        conventions: what the normals, forces and dimensions turned out to be, by topic.
        unknown_columns: of the files, not understood.
        notes: of the reader.
    """

    format: str
    files: tuple[str, ...] = ()
    frames: int = 0
    frames_read: int = 0
    empty_frames: int = 0
    grains: int = 0
    contacts: int | None = None
    walls_dropped: int = 0
    wall_contacts_dropped: int = 0
    duplicates_dropped: int = 0
    self_contacts_dropped: int = 0
    rattlers: int | None = None
    round_grains: bool = True
    skipped_frames: list[dict[str, Any]] = field(default_factory=list)
    conventions: dict[str, str] = field(default_factory=dict)
    unknown_columns: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def add(self, frame: ImportSummary) -> None:
        """Take over the counts and conventions of one more frame."""
        for name in _SUMS:
            setattr(self, name, getattr(self, name) + getattr(frame, name))
        for name in _LATEST:
            setattr(self, name, getattr(frame, name))
        self.conventions.update(frame.conventions)

    def plain(self) -> Mapping[str, Any]:
        """Plain data, for JSON."""
        return {name: getattr(self, name) for name in self.__slots__}

    def lines(self) -> list[str]:
        """Lines for a person; what is zero or unknown is left out."""
        dropped = {
            "wall bodies": self.walls_dropped,
            "wall contacts": self.wall_contacts_dropped,
            "pairs listed twice": self.duplicates_dropped,
            "contacts of a grain with itself": self.self_contacts_dropped,
        }
        left_out = ", ".join(f"{count} {what}" for what, count in dropped.items() if count)
        text = [
            f"{self.format}: {_many(self.frames, 'frame')} in "
            f"{_many(len(self.files), 'file')}, {self.grains} grains, "
            + ("no contacts listed" if self.contacts is None else f"{self.contacts} contacts")
            + ("" if self.rattlers is None else f", {self.rattlers} rattlers")
        ]
        if left_out:
            text.append(f"left out: {left_out}")
        if self.empty_frames:
            text.append(f"empty frames: {self.empty_frames}")
        if self.skipped_frames:
            text.append(f"warning: {len(self.skipped_frames)} damaged frames skipped")
            text += [f"frame {one['frame']} skipped: {one['reason']}"
                     for one in self.skipped_frames[:_SHOWN]]  # fmt: skip
            rest = [str(one["frame"]) for one in self.skipped_frames[_SHOWN:]]
            text += [f"also skipped: {', '.join(rest)}"] if rest else []
        text += [f"{topic}: {what}" for topic, what in self.conventions.items()]
        if self.unknown_columns:
            text.append(f"columns not understood: {', '.join(self.unknown_columns)}")
        return text + list(self.notes)
