"""The low-cost peer of ros2_latency.py: Cyclone DDS sends frames that were encoded before, and takes pairs undecoded.

    ros2_latency_cyclone.py DOMAIN BODIES SAMPLES

Prints one JSON list: microseconds from write() to the pairs in hand, one number a sample; null: no answer within 2 s.
"""

import json
import random
import struct
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests/python/ros2"))

from cyclone_types import make, zero  # noqa: E402
from cyclonedds._clayer import ddspy_take  # noqa: E402
from cyclonedds.core import InstanceState, Policy, Qos, ReadCondition, SampleState, ViewState, WaitSet  # noqa: E402
from cyclonedds.domain import DomainParticipant  # noqa: E402
from cyclonedds.pub import DataWriter  # noqa: E402
from cyclonedds.sub import DataReader  # noqa: E402
from cyclonedds.topic import Topic  # noqa: E402
from cyclonedds.util import duration  # noqa: E402

PAUSE_S = 0.005
ANY = SampleState.Any | ViewState.Any | InstanceState.Any
# Numbers that stand for those of the next frame while their places are looked for.
SEQ, SENT_NS, NANOSEC = 0x1122334455667788, 0x1222334455667789, 0x13223344

domain, bodies, samples = map(int, sys.argv[1:])
participant = DomainParticipant(domain)
reliable = Policy.Reliability.Reliable(duration(seconds=1))
plain = Qos(reliable, Policy.History.KeepLast(10), Policy.DataRepresentation(use_cdrv0_representation=True))
frames = DataWriter(participant, Topic(participant, "rt/sweepd/transforms", make("sweepd_msgs/msg/BodyTransforms")), qos=plain)
pairs = DataReader(participant, Topic(participant, "rt/sweepd/pairs", make("sweepd_msgs/msg/Pairs")), qos=Qos(reliable, Policy.History.KeepLast(10)))
waitset = WaitSet(participant)
waitset.attach(ReadCondition(pairs, ANY))

dice = random.Random(29)
frame = zero("sweepd_msgs/msg/BodyTransforms")
frame.source, frame.session, frame.flags, frame.header.frame_id = "sim", dice.getrandbits(60) | 1, 1, "world"
frame.header.stamp.sec, frame.header.stamp.nanosec, frame.seq, frame.sent_ns = 2, NANOSEC, SEQ, SENT_NS
for number in range(bodies):
    body = zero("sweepd_msgs/msg/BodyTransform")
    body.name, body.pose.orientation.w = f"b{number}", 1.0
    body.pose.position.x, body.pose.position.y, body.pose.position.z = (dice.uniform(0, 4) for _ in range(3))
    frame.transforms.append(body)
encoded = bytearray(frame.serialize(use_version_2=False))
places = [encoded.index(struct.pack("<Q", SEQ)), encoded.index(struct.pack("<Q", SENT_NS)), encoded.index(struct.pack("<I", NANOSEC))]
xs = [encoded.index(struct.pack("<d", body.pose.position.x)) for body in frame.transforms]
frame.serialize = lambda use_version_2: bytes(encoded)


def stamp_of(raw):
    """`newest_stamp_ns` of an encoded message with a `TickHeader` behind its header."""
    at = 12
    at += 4 + struct.unpack_from("<I", raw, at)[0]
    at = 4 + (at - 4 + 7) // 8 * 8
    return struct.unpack_from("<Q", raw, at + 32)[0]


def sample(number):
    """One frame, each body moved; microseconds until its pairs."""
    for body, at in zip(frame.transforms, xs):
        body.pose.position.x += dice.uniform(-5e-3, 5e-3)
        struct.pack_into("<d", encoded, at, body.pose.position.x)
    struct.pack_into("<Q", encoded, places[0], number)
    struct.pack_into("<I", encoded, places[2], number)
    wanted = 2 * 10**9 + number
    struct.pack_into("<Q", encoded, places[1], time.clock_gettime_ns(time.CLOCK_BOOTTIME))
    start = time.perf_counter_ns()
    frames.write(frame)
    while time.perf_counter_ns() - start < 2 * 10**9:
        taken = ddspy_take(pairs._ref, ANY, 10)
        arrived = time.perf_counter_ns()
        if any(stamp_of(raw) == wanted for raw, info in taken if info.valid_data):
            return (arrived - start) / 1e3
        waitset.wait(duration(milliseconds=50))
    return None


seq = 1
while sample(seq) is None and seq < 20:
    seq += 1
found = []
for number in range(samples + 100):
    found.append(sample(seq + 1 + number))
    time.sleep(PAUSE_S)
print(json.dumps(found[100:]))
