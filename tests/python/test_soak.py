"""The soak of the whole system, see `soak/__init__.py`: some seconds in each mode, and with SWEEPD_CI_SLOW=1 for long.

Needs `SWEEPD=path/to/sweepd` and the package of msgs/python with its wheels. SWEEPD_SOAK_S are the seconds of the long
one, of all modes together (1200), SWEEPD_SOAK_SEED its first seed and that of the short one (2).
"""

import os
import time

import pytest
from needed import needed

needed("sweepd")

from soak.__main__ import soak  # noqa: E402
from soak.driver import MODES  # noqa: E402

SWEEPD = os.environ.get("SWEEPD")
pytestmark = pytest.mark.skipif(not SWEEPD, reason="SWEEPD names no binary")
SEED = int(os.environ.get("SWEEPD_SOAK_SEED", "2"))
#: Of one mode.
SHORT_S = 5.0
LONG_S = float(os.environ.get("SWEEPD_SOAK_S", "1200")) / len(MODES)
#: Of one seed; each has its own scene, budgets and deeds.
SEED_S = 60.0


@pytest.mark.parametrize("mode", MODES)
def test_every_tick_of_a_mixed_run_is_as_the_contract_and_the_formulas_say(mode, tmp_path):
    report = soak(SEED, mode, SHORT_S, tmp_path)
    assert not report.faults, str(report)
    # it was no run beside the point
    counts = report.counts
    assert counts["ticks whole"] > 20 and counts["daemons"] > 1 and counts["begin"] + counts["possible"] > 0, counts


@pytest.mark.skipif(os.environ.get("SWEEPD_CI_SLOW") != "1", reason="slow: set SWEEPD_CI_SLOW=1")
@pytest.mark.parametrize("mode", MODES)
def test_so_it_is_for_long_and_with_many_seeds(mode, tmp_path):
    until_s, seed = time.monotonic() + LONG_S, SEED
    while (left_s := until_s - time.monotonic()) > 0.0:
        seed += 1
        folder = tmp_path / str(seed)
        folder.mkdir()
        report = soak(seed, mode, min(left_s, SEED_S), folder)
        assert not report.faults, str(report)
