"""A Cyclone DDS program without ROS 2: writes `~/transforms`, reads `~/tick` and `~/contacts`, prints what it read.

    peer_cyclone.py DOMAIN SECONDS

Two hands come nearer, 0.02 m a frame; a JSON line for each tick that a frame caused, and one for each contact.
"""

import json
import sys
import time

from cyclone_types import make, zero
from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

domain, seconds = int(sys.argv[1]), float(sys.argv[2])
participant = DomainParticipant(domain)
reliable = Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.History.KeepLast(50))
# what ROS 2 writes: the first version of the encoding
plain = Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.History.KeepLast(10),
            Policy.DataRepresentation(use_cdrv0_representation=True))  # fmt: skip


def topic(name, kind):
    return Topic(participant, f"rt/sweepd/{name}", make(f"sweepd_msgs/msg/{kind}"))


ticks = DataReader(participant, topic("tick", "Tick"), qos=reliable)
contacts = DataReader(participant, topic("contacts", "Contacts"), qos=reliable)
frames = DataWriter(participant, topic("transforms", "BodyTransforms"), qos=plain)

seq = 0
until = time.monotonic() + seconds
while time.monotonic() < until:
    seq += 1
    frame = zero("sweepd_msgs/msg/BodyTransforms")
    frame.source, frame.session, frame.seq, frame.flags = "sim", 77, seq, 1
    frame.header.stamp.sec, frame.header.stamp.nanosec = seq, 5
    frame.header.frame_id = "world"
    for name, x in (("left", 0.0), ("right", max(0.5, 2.0 - 0.02 * seq))):
        body = zero("sweepd_msgs/msg/BodyTransform")
        body.name, body.pose.position.x, body.pose.orientation.w = name, x, 1.0
        frame.transforms.append(body)
    frames.write(frame)
    time.sleep(0.02)
    for tick in ticks.take(N=100):
        if tick.sources and tick.sources[0].session == 77:
            print(json.dumps({"tick": tick.tick_header.tick, "seq": tick.sources[0].seq, "colliding": tick.colliding,
                              "stamp_ns": tick.tick_header.newest_stamp_ns, "bodies": tick.bodies}), flush=True)  # fmt: skip
    for message in contacts.take(N=100):
        for contact in message.contacts:
            print(json.dumps({"of": message.tick_header.tick, "a": contact.name_a, "b": contact.name_b,
                              "gap_m": contact.gap_m, "normal": contact.normal.x, "kind": contact.kind}), flush=True)  # fmt: skip
