"""Where a figure comes from: the columns that each CSV of results begins with."""

import os
import subprocess
from pathlib import Path


def machine() -> str:
    """The processor and how many of its cores are here."""
    fields: dict[str, str] = {}
    for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
        key, _, value = line.partition(":")
        fields.setdefault(key.strip(), value.strip())
    avx512 = "avx512" if "avx512f" in fields.get("flags", "") else "no avx512"
    cpu = f"{fields['model name']} family {fields['cpu family']} model {fields['model']}"
    return f"{cpu} {avx512} {os.cpu_count()} cores"


def commit() -> str:
    """The commit that is checked out."""
    return _told("git", "rev-parse", "--short", "HEAD")


def compiler() -> str:
    """The Rust compiler."""
    return _told("rustc", "--version").replace(",", " ")


def _told(*command: str) -> str:
    told = subprocess.run(command, cwd=Path(__file__).parent, capture_output=True, text=True, check=False)
    return told.stdout.strip()
