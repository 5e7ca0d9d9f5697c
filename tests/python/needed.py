"""What the tests need: skipped where a module is missing, but in the gate (SWEEPD names a binary) that is a failure."""

import importlib
import os

import pytest


def needed(name):
    if os.environ.get("SWEEPD"):
        return importlib.import_module(name)
    return pytest.importorskip(name)
