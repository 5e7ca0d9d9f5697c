"""The committed list of types is what rosidl makes of the interfaces; the Rust structs are held against that list."""

import sys
from pathlib import Path

from type_lines import lines

ROOT = Path(__file__).resolve().parents[3]


def test_the_committed_types_are_those_of_the_generator():
    committed = (ROOT / "tests/data/ros2_types.txt").read_text().splitlines()
    made = lines(Path(sys.prefix) / "share")
    assert committed == made, "run type_lines.py, and follow it in src/wire/ros"


def test_every_interface_is_in_the_build_list():
    package = ROOT / "msgs/sweepd_msgs"
    listed = (package / "CMakeLists.txt").read_text()
    files = [f'"{path.relative_to(package)}"' for folder in ("msg", "srv") for path in (package / folder).iterdir()]
    assert files and [name for name in files if name not in listed] == []
