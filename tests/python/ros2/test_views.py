"""The view files for RViz and Foxglove: they are read, and each topic, field and frame they name is one that the node has.

Neither program is started here: there is no wheel of either.
"""

import json
import re
from pathlib import Path

import yaml
from scenes import HANDS
from sweepd_msgs.msg import Pair, Pairs, State, Tick

FILES = Path(__file__).resolve().parents[3] / "launch-free-scripts/ros2"
# What others send, in the demo too.
OTHERS = {"/tf"}


def published(room):
    """Topics of the node with their types."""
    room.daemon(HANDS)
    node = room.node()
    topics = lambda: dict(node.get_publisher_names_and_types_by_node("sweepd", "/")) if "sweepd" in node.get_node_names() else {}  # noqa: E731
    return room.until(lambda: (lambda all: "/sweepd/markers" in all and "/diagnostics" in all and all)(topics()), "its topics")


def test_the_rviz_file_is_read_and_shows_what_the_node_publishes(room):
    manager = yaml.safe_load((FILES / "sweepd.rviz").read_text())["Visualization Manager"]
    shown = {d["Topic"]["Value"]: d for d in manager["Displays"] if "Topic" in d}
    topics = published(room)
    assert topics["/sweepd/markers"] == ["visualization_msgs/msg/MarkerArray"]
    assert set(shown) == {"/sweepd/markers"} and shown["/sweepd/markers"]["Class"].endswith("/MarkerArray")
    assert shown["/sweepd/markers"]["Topic"]["Reliability Policy"] == "Reliable"
    assert manager["Global Options"]["Fixed Frame"] == "world"


def test_the_foxglove_layout_is_read_and_names_topics_and_fields_of_the_node(room):
    layout = json.loads((FILES / "foxglove_layout.json").read_text())
    topics = published(room)
    kinds = {"/sweepd/state": State, "/sweepd/tick": Tick, "/sweepd/pairs": Pairs}
    text = json.dumps(layout["configById"])
    named = set(re.findall(r'"(/[a-z_/]+)', text))
    assert named and named <= set(topics) | OTHERS, named - set(topics)
    paths = re.findall(r'"(/[a-z_/]+)\.([a-z_]+)(?:\[:\]\{([a-z_]+))?', text)
    assert len(paths) >= 6
    for topic, field, inner in paths:
        fields = kinds[topic].get_fields_and_field_types()
        assert field in fields and (not inner or inner in Pair.get_fields_and_field_types()), (topic, field, inner)

    def leaves(node):
        return [node] if isinstance(node, str) else leaves(node["first"]) + leaves(node["second"])

    assert sorted(leaves(layout["layout"])) == sorted(layout["configById"]), "each panel has its place"
