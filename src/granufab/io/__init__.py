"""Files: the run file, series as CSV, datasets as CSV or NetCDF, summaries as JSON, FCLIB."""

from granufab.io.checkpoint_file import Checkpoint, read_checkpoint, write_checkpoint
from granufab.io.column_map import read_column_map
from granufab.io.fclib import read_fclib, read_fclib_guesses, read_fclib_solution, write_fclib
from granufab.io.foreign_run import ForeignFrames
from granufab.io.formats import FORMATS, Format, detect, format_of, read
from granufab.io.import_summary import ImportSummary
from granufab.io.provenance import cpu_name, provenance
from granufab.io.read_options import ReadOptions
from granufab.io.run_file import RunFileWriter
from granufab.io.run_lock import RunLock
from granufab.io.run_reader import describe
from granufab.io.series_csv import read_series, write_dataset, write_series
from granufab.io.summary import json_text, write_json, write_text
from granufab.io.writers import WRITERS, write

__all__ = [
    "FORMATS",
    "WRITERS",
    "Checkpoint",
    "ForeignFrames",
    "Format",
    "ImportSummary",
    "ReadOptions",
    "RunFileWriter",
    "RunLock",
    "cpu_name",
    "describe",
    "detect",
    "format_of",
    "json_text",
    "provenance",
    "read",
    "read_checkpoint",
    "read_column_map",
    "read_fclib",
    "read_fclib_guesses",
    "read_fclib_solution",
    "read_series",
    "write",
    "write_checkpoint",
    "write_dataset",
    "write_fclib",
    "write_json",
    "write_series",
    "write_text",
]
