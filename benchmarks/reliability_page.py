"""The numbers of docs/reliability.md from docs/reliability.json."""

from __future__ import annotations

from typing import Any

Entries = dict[str, dict[str, Any]]
Told = list[dict[str, Any]]


class Counts:
    """What the tests counted, by file and name of the test."""

    def __init__(self, entries: Entries) -> None:
        self.entries = entries

    def told(self, test: str, speed: str) -> Told:
        """What all cases of a test told."""
        return self.entries[f"tests/{test} {speed}"]["told"]

    def passed(self, *tests: str) -> int:
        """Cases that passed, of all these tests."""
        return sum(self.entries[f"tests/{test} quick"]["passed"] for test in tests)

    def total(self, told: Told, name: str) -> int:
        """One count over all cases."""
        return sum(one.get(name, 0) for one in told)


def _kills(c: Counts) -> str:
    (one,) = c.told("reliability/test_kill_resume.py::test_killed_at_any_time_the_same_end", "slow")
    late = one["runs"] - one["killed"]
    return (
        f"{one['killed']} kills, {one['inside_writes']} of them inside writes ({late} more runs "
        "ended first): the same SHA-256 of all frames and the series each time (*slow*)"
    )


def _checkpoints(c: Counts) -> str:
    test = "reliability/test_kill_resume.py::test_from_every_checkpoint_the_same_end"
    told = c.told(test, "slow")
    threads = sorted({one["threads"] for one in told})
    kinds = len(told) // len(threads)
    each = {one["checkpoints"] for one in told}
    assert len(each) == 1
    return (
        f"{kinds} loadings (disks with rest and reversal, walls, sheared spheres) × {each.pop()} "
        f"checkpoints × {' and '.join(map(str, threads))} threads, the same bits (*slow*)"
    )


def _crashes(c: Counts) -> str:
    file = "io/test_checkpoint_file.py::"
    steps = c.passed(file + "test_a_crash_at_any_step_leaves_a_valid_checkpoint")
    name = file + "test_truncations_and_mutations_never_give_other_data"
    damaged = c.total(c.told(name, "quick"), "damaged")
    return (
        f"fsync, both renames, fsync of the folder, each before and after, by crash and by error: "
        f"{steps} of {steps}; {damaged} damaged checkpoints, all told, the one before used"
    )


def _full(c: Counts) -> str:
    test = "reliability/test_failing_runs.py::"
    name = test + "test_a_full_disk_ends_the_run_in_one_line_and_it_resumes"
    told = sorted(c.told(name, "quick") + c.told(name, "slow"), key=lambda one: one["share"])
    shares = [f"{100 * one['share']:.0f}" for one in told]
    count = len(told) + c.passed(test + "test_a_full_disk_at_a_checkpoint_keeps_the_one_before")
    return (
        f"full at {', '.join(shares[:-1])} and {shares[-1]} % of the run file, and at a "
        f"checkpoint: {count} of {count} with the same SHA-256"
    )


def _damaged(c: Counts, what: str) -> str:
    told = c.told(f"io/test_damaged_run_file.py::test_many_{what}", "slow")
    names = ("refused", "some frames", "same", "shorter")
    counts = {name: c.total(told, name) for name in names}
    total = sum(counts.values())
    words = {
        "refused": "refused",
        "some frames": "with the damaged frame refused",
        "same": "without effect",
        "shorter": "shorter with a warning",
    }
    listed = ", ".join(f"{count:,} {words[name]}" for name, count in counts.items() if count)
    return f"{total:,} of them: {listed}, **0 different** (*slow*)"


def _foreign(c: Counts) -> str:
    told = c.told("io/test_damaged_files.py::test_cuts", "quick")
    files = c.total(told, "files")
    tried = "200 truncations + 200 changed bytes"
    return f"{len(told)} examples of all formats, {files} files × ({tried})"


def _settings(c: Counts) -> str:
    texts = []
    for speed in ("quick", "slow"):
        (one,) = c.told("reliability/test_hostile_settings.py::", speed)
        total = one["refused"] + one["read"]
        texts.append(
            f"{total:,} examples: {one['refused']:,} refused, {one['read']:,} valid and read, the "
            f"slowest in {one['seconds']:.2f} s of processor time"
        )
    return f"{texts[0]}; *slow*: {texts[1]}"


def _states(c: Counts) -> str:
    guards = "reliability/test_step_guards.py::test_"
    names = (
        *("a_fault_of_a_grain_ends_a_call_of_many_steps_at_once", "a_broken_cell_ends_the_step"),
        *("a_fault_in_the_middle_of_a_call_ends_it_there", "a_broken_impulse_ends_the_step"),
        "too_large_an_overlap_names_both_grains",
    )
    faults = c.passed(*(guards + name for name in names))
    runs = "test_a_broken_state_ends_the_run_and_keeps_what_was_good"
    whole = c.passed("reliability/test_failing_runs.py::" + runs)
    return (
        f"{faults} faults in 2D and 3D, with 1 and 2 threads; {whole} whole runs, resumed to the "
        "same bits"
    )


def _fit(c: Counts) -> str:
    test = "reliability/test_preflight.py::test_a_hundred_million_grains_are_refused_in_one_line"
    (one,) = c.told(test, "quick")
    limit = one["limit"] / 2**30
    return f"10⁸ disks in a process limited to {limit:.0f} GB: {one['needed']} needed"


def _soak(c: Counts) -> str:
    test = "reliability/test_soak.py::test_a_resting_stack_neither_sinks_nor_loses_memory"
    told = c.told(test, "slow")
    rigid = [
        f"rigid {one['make']} {one['before']:.1e} to {one['worst']:.1e} R"
        for one in told
        if one["rigid"]
    ]
    soft = max(abs(one["worst"] / one["before"] - 1) for one in told if not one["rigid"])
    memory = max(one["memory"] for one in told)
    seconds = sum(one["seconds"] for one in told)
    return (
        f"{'; '.join(rigid)}; compliant ones changed by {soft:.0e} of it at most; memory "
        f"{100 * memory:+.2f} % at most; {seconds:.0f} s together (*slow*)"
    )


def _memory(c: Counts, test: str, grains: str) -> str:
    name = f"reliability/test_million_grains.py::test_{test}"
    (one,) = c.told(name, "slow")
    texts = [f"{one['bytes']:,.0f} B a grain with {grains}", f"{one['steps']} compaction steps"]
    if "searches" in one:
        texts.append(f"{one['searches']:.0f} searches")
    if "base" in one:
        texts[0] += f" above the {one['base'] / 1e6:.0f} MB of the program"
    seconds = c.entries[f"tests/{name} slow"]["seconds"]
    if seconds is not None:
        texts.append(f"about {seconds / 60:.0f} minutes")
    return ", ".join(texts) + " (*slow*)"


def _streams(c: Counts) -> str:
    test = "reliability/test_out_of_core.py::test_a_run_file_of_300_megabytes_takes_no_more_memory"
    told = c.told(test, "slow")
    grown = ", ".join(f"{one['grown_frames']:+.1f} ({one['verb']})" for one in told)
    (quick,) = {
        one["frames"] for one in c.told(test.replace(*QUICK), "quick") if one["verb"] == "measure"
    }
    return (
        f"a {told[0]['megabytes']:.0f} MB file of {told[0]['frames']} frames instead of 4: {grown} "
        f"frames of memory (*slow*; the quick test: {quick} frames)"
    )


QUICK = ("a_run_file_of_300_megabytes_takes_no_more_memory", "a_longer_run_takes_no_more_memory")


def _campaign(c: Counts) -> str:
    (local,) = c.told("campaign/test_local.py::test_a_killed_worker_costs_no_case", "slow")
    name = "test_a_killed_dask_worker_costs_no_case_and_changes_no_number"
    (dask,) = c.told(f"campaign/test_dask.py::{name}", "slow")
    assert local["cases"] == dask["cases"]
    return (
        f"{local['cases']} cases on the local pool and on Dask with two workers, one killed: all "
        "done, the datasets identical (*slow*); the same by job scripts"
    )


def _viewer(c: Counts) -> str:
    file = "viewer/test_server.py::test_"
    names = ("a_foreign_host_is_refused", "a_foreign_origin_is_refused")
    foreign = c.passed(*(file + name for name in names))
    outside = c.passed(file + "no_path_reaches_a_file")
    tokens = c.passed(file + "without_the_token_nothing_is_given")
    return (
        f"{foreign} foreign Hosts and Origins: {foreign} × 403; {outside} paths out of the page's "
        f"folder: {outside} × 404; {tokens} pairs of a path and a wrong token: 403 each, in the "
        "address, the header and the cookie; other methods 405"
    )


def _seconds(c: Counts) -> str:
    (one,) = c.told("reliability/test_out_of_core.py::test_seconds_of_two_workers", "slow")
    gain = one["one"] / one["two"]
    return (
        f"{one['frames']} frames of {one['grains']:,} disks take {one['one']:.2f} s in one process "
        f"and {one['two']:.2f} s with two workers ({gain:.1f} times as fast; one measurement)"
    )


def _demand(c: Counts) -> str:
    from granufab.simulate.demand import (
        FIXED_BYTES,
        FRAME_BYTES,
        GRAIN_BYTES,
        PROGRAM_BYTES,
        PROGRAM_SAMPLE,
    )

    name = "test_the_preflight_promises_no_less_than_compaction_takes"
    told = {
        one["dimension"]: one
        for one in c.told(f"reliability/test_million_grains.py::{name}", "quick")
    }
    fixed = f"{FIXED_BYTES / 1e6:.0f} MB"
    rows = [
        ("libraries, and compiling the kernels the first time", fixed, fixed),
        ("memory of a grain", *(f"{GRAIN_BYTES[d] / 1e3:.1f} kB" for d in (2, 3))),
        (
            "of it measured in the compaction of a sample",
            *(f"{told[d]['bytes'] / 1e3:.2f} kB ({told[d]['grains']:,} grains)" for d in (2, 3)),
        ),
        (
            f"linear programs of a frictionless sample, a grain, at {PROGRAM_SAMPLE:,} grains",
            *(f"{PROGRAM_BYTES[d] / 1e3:.0f} kB" for d in (2, 3)),
        ),
        ("run file, a grain and frame", *(f"{FRAME_BYTES[d]:.0f} B" for d in (2, 3))),
    ]
    lines = ["| | disks | spheres |", "|---|---|---|"]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows)])


def cells(entries: Entries) -> dict[str, str]:
    """The text of each marked place of the page."""
    c = Counts(entries)
    spheres = "a_hundred_thousand_spheres_stay_within_what_the_preflight_promises"
    return {
        "kills": _kills(c),
        "checkpoints": _checkpoints(c),
        "crashes": _crashes(c),
        "full": _full(c),
        "truncations": _damaged(c, "truncations_open_to_what_is_there"),
        "changes": _damaged(c, "mutations_are_never_silent"),
        "foreign": _foreign(c),
        "settings": _settings(c),
        "states": _states(c),
        "fit": _fit(c),
        "soak": _soak(c),
        "million": _memory(c, "a_million_disks_stay_under_1200_bytes_a_grain", "10⁶ disks"),
        "spheres": _memory(c, spheres, "10⁵ spheres"),
        "streams": _streams(c),
        "campaign": _campaign(c),
        "viewer": _viewer(c),
        "seconds": _seconds(c),
    }


def tables(entries: Entries) -> dict[str, str]:
    """The tables of the page."""
    return {"demand": _demand(Counts(entries))}
