"""Files: the run file, series as CSV, datasets as CSV or NetCDF, summaries as JSON, FCLIB."""

from granufab.io.fclib import read_fclib, read_fclib_guesses, read_fclib_solution, write_fclib
from granufab.io.formats import FORMATS, Format, detect, read
from granufab.io.provenance import cpu_name, provenance
from granufab.io.run_file import RunFileWriter
from granufab.io.run_reader import describe
from granufab.io.series_csv import read_series, write_dataset, write_series
from granufab.io.summary import json_text, write_json, write_text

__all__ = [
    "FORMATS",
    "Format",
    "RunFileWriter",
    "cpu_name",
    "describe",
    "detect",
    "json_text",
    "provenance",
    "read",
    "read_fclib",
    "read_fclib_guesses",
    "read_fclib_solution",
    "read_series",
    "write_dataset",
    "write_fclib",
    "write_json",
    "write_series",
    "write_text",
]
