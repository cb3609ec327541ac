"""Campaigns: one case varied over parameters and seeds, run, continued and gathered."""

from __future__ import annotations

from granufab.campaign.engine import prepare_manifest, run_campaign
from granufab.campaign.expansion import Member, expand
from granufab.campaign.results import gather
from granufab.campaign.settings import Latin, Parameter, Sweep, load_sweep, parse_sweep

__all__ = [
    "Latin",
    "Member",
    "Parameter",
    "Sweep",
    "expand",
    "gather",
    "load_sweep",
    "parse_sweep",
    "prepare_manifest",
    "run_campaign",
]
