"""Prints the types that sweepd speaks on ROS 2, field by field, as the generator's JSON type descriptions say.

    .venv-ros2/bin/python tests/python/ros2/type_lines.py > tests/data/ros2_types.txt

`tests/ros2_types.rs` holds the Rust structs against that file, `test_types.py` the file against the generator.
"""

import json
import sys
from pathlib import Path

# What the node sends, takes and answers; the types inside them follow by themselves.
ROOTS = """
sweepd_msgs/msg/BodyTransforms sweepd_msgs/msg/Contacts sweepd_msgs/msg/Names sweepd_msgs/msg/Pairs
sweepd_msgs/msg/State sweepd_msgs/msg/Tick
sweepd_msgs/srv/AttachBody sweepd_msgs/srv/EnableBody sweepd_msgs/srv/Gap sweepd_msgs/srv/PutBody
sweepd_msgs/srv/RemoveBody sweepd_msgs/srv/Reset sweepd_msgs/srv/SetFilter sweepd_msgs/srv/TickNow
tf2_msgs/msg/TFMessage geometry_msgs/msg/PoseStamped nav_msgs/msg/Odometry rosgraph_msgs/msg/Clock
ros_gz_interfaces/msg/Contacts visualization_msgs/msg/MarkerArray diagnostic_msgs/msg/DiagnosticArray
""".split()

# type_description_interfaces/msg/FieldType: below 48 a single value, then arrays, bounded and unbounded sequences.
SIMPLE = {
    1: None, 2: "int8", 3: "uint8", 4: "int16", 5: "uint16", 6: "int32", 7: "uint32", 8: "int64", 9: "uint64",
    10: "float32", 11: "float64", 13: "char", 15: "bool", 16: "byte", 17: "string",
}  # fmt: skip


def type_word(field_type: dict) -> str:
    """The type of a field as a .msg file writes it."""
    kind, simple = divmod(field_type["type_id"], 48)
    word = SIMPLE[simple] or field_type["nested_type_name"]
    return word + ["", f"[{field_type['capacity']}]", f"[<={field_type['capacity']}]", "[]"][kind]


def lines(share: Path) -> list[str]:
    """Every type once, by name, each with its hash and then its fields in order."""
    types, hashes = {}, {}
    for root in ROOTS:
        described = json.loads((share / f"{root}.json").read_text())
        hashes |= {entry["type_name"]: entry["hash_string"] for entry in described["type_hashes"]}
        # A message has one description; a service has one that refers to its request and response.
        part = described["type_description_msg"]
        for one in [part["type_description"], *part["referenced_type_descriptions"]]:
            types[one["type_name"]] = one["fields"]
    out = []
    for name in sorted(types):
        # The service types themselves and their introspection never travel.
        if name.endswith("_Event") or (("/srv/" in name) and not name.endswith(("_Request", "_Response"))):
            continue
        if name.startswith("service_msgs/"):
            continue
        out.append(f"{name} {hashes[name]}")
        out += [f"  {field['name']} {type_word(field['type'])}" for field in types[name]]
    return out


if __name__ == "__main__":
    print("\n".join(lines(Path(sys.prefix) / "share")))
