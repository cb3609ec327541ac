"""Campaigns on clusters without Dask: a manifest, and scripts that run one line of it."""

from __future__ import annotations

import csv
import io
import shlex
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path

from granufab.campaign.expansion import Member
from granufab.campaign.folder import CampaignFolder
from granufab.io import write_text
from granufab.simulate.settings import to_toml

__all__ = ["write_manifest"]

RUN_CASE = """\
#!/bin/sh
# Runs one line of manifest.csv: sh run-case.sh NUMBER
# A case that was begun goes on from its checkpoint, one that is done is left alone.
here=$(cd "$(dirname "$0")" && pwd) || exit 2
id=$(awk -F, -v n="$1" '$1 == n { print $2; exit }' "$here/manifest.csv")
[ -n "$id" ] || { echo "run-case.sh: manifest.csv has no line $1" >&2; exit 2; }
folder="$here/cases/$id"
[ "$(cat "$folder/job.code" 2>/dev/null)" = 0 ] && exit 0
rm -f "$folder/job.code"
@cd@
GRANUFAB_THREADS=${SLURM_CPUS_PER_TASK:-@threads@}
export GRANUFAB_THREADS
granufab run "$folder/settings.toml" --out "$folder" --resume 2> "$folder/job.log" &
child=$!
trap 'kill -TERM "$child" 2>/dev/null' TERM INT  # it writes a checkpoint and ends
wait "$child"
code=$?
while kill -0 "$child" 2>/dev/null; do wait "$child"; code=$?; done
echo "$code" > "$folder/job.code"
exit "$code"
"""

ARRAY = """\
#!/bin/sh
# SLURM job array, one case each: cd to this folder, then: sbatch job-array.sh
# Edit the time limit; five minutes before it a case writes its checkpoint and ends, and the
# same command later goes on with it. A % limits how many run at once: --array=1-500%50
#SBATCH --job-name=@name@
#SBATCH --array=@array@
#SBATCH --ntasks=1
#SBATCH --cpus-per-task=@threads@
#SBATCH --time=24:00:00
#SBATCH --signal=B:TERM@300
#SBATCH --output=/dev/null
cd "${SLURM_SUBMIT_DIR:-.}" || exit 2
trap 'kill -TERM "$child" 2>/dev/null' TERM
sh run-case.sh "$SLURM_ARRAY_TASK_ID" &
child=$!
wait "$child"
code=$?
while kill -0 "$child" 2>/dev/null; do wait "$child"; code=$?; done
exit "$code"
"""

RUN_ALL = """\
#!/bin/sh
# Runs every case of manifest.csv on one machine: sh run-all.sh [PROCESSES]
cd "$(dirname "$0")" || exit 2
tail -n +2 manifest.csv | cut -d, -f1 | xargs -n 1 -P "${1:-@workers@}" sh run-case.sh
"""


def write_manifest(
    place: CampaignFolder,
    members: Sequence[Member],
    done: set[str],
    *,
    name: str,
    threads: int,
    workers: int,
) -> Path:
    """Write ``manifest.csv``, the settings of each case, and the scripts that run them.

    Lines keep their numbers when cases are added, so that a job array that is under way stays
    right; the array of the script holds the lines that are not done.

    Args:
        place: the campaign's folder.
        members: its cases.
        done: ids of those that are done.
        name: of the campaign.
        threads: of each run.
        workers: processes of the script for one machine.
    Returns:
        The manifest.
    """
    known = _numbers(place.manifest)
    free = max(known.values(), default=0)
    numbers: dict[str, int] = {}
    for member in members:
        if member.id not in known:
            free += 1
        numbers[member.id] = known.get(member.id, free)
        folder = place.case(member.id)
        if not (folder / "settings.toml").exists():
            write_text(to_toml(member.case), folder / "settings.toml")
        if member.id in done:
            write_text("0\n", folder / "job.code")
    _write_lines(place.manifest, numbers)
    open_lines = sorted(number for one, number in numbers.items() if one not in done)
    names_files = any(m.case.sample.file or m.case.sample.sizes.file for m in members)
    texts = {
        "cd": f"cd {shlex.quote(str(Path.cwd()))} || exit 2" if names_files else 'cd "$here"',
        "threads": str(threads),
        "workers": str(workers),
        "name": _word(name),
        "array": _ranges(open_lines) or "1",
    }
    scripts = {"run-case.sh": RUN_CASE, "job-array.sh": ARRAY, "run-all.sh": RUN_ALL}
    for file, text in scripts.items():
        for key, value in texts.items():
            text = text.replace(f"@{key}@", value)
        write_text(text, place.path / file)
    return place.manifest


def _word(name: str) -> str:
    return "".join(c if c.isascii() and c.isalnum() else "-" for c in name)[:40] or "sweep"


def _numbers(manifest: Path) -> dict[str, int]:
    """Lines of an earlier manifest by id; none where it cannot be read."""
    try:
        rows = list(csv.reader(io.StringIO(manifest.read_text(encoding="utf-8"))))[1:]
        return {row[1]: int(row[0]) for row in rows}
    except (OSError, ValueError, IndexError, csv.Error):
        return {}


def _write_lines(manifest: Path, numbers: dict[str, int]) -> None:
    lines = [f"{number},{one}" for one, number in sorted(numbers.items(), key=lambda item: item[1])]
    write_text("\n".join(["number,id", *lines]) + "\n", manifest)


def _ranges(numbers: Sequence[int]) -> str:
    """1, 2, 3, 7 → "1-3,7"."""
    parts = []
    for _, group in groupby(enumerate(numbers), key=lambda item: item[1] - item[0]):
        run = [number for _, number in group]
        parts.append(str(run[0]) if len(run) == 1 else f"{run[0]}-{run[-1]}")
    return ",".join(parts)
