"""The low-cost peer of ros2_latency.py: Cyclone DDS sends frames that were encoded before, and takes pairs undecoded.

    ros2_latency_cyclone.py DOMAIN BODIES SAMPLES

Prints one JSON list: microseconds from write() to the pairs in hand, one number a sample; null: no answer within 2 s.
"""

import json
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
from ros2_frame import EncodedFrame, fill, stamp_of  # noqa: E402

PAUSE_S = 0.005
ANY = SampleState.Any | ViewState.Any | InstanceState.Any
SEED = 29

domain, bodies, samples = map(int, sys.argv[1:])
participant = DomainParticipant(domain)
reliable = Policy.Reliability.Reliable(duration(seconds=1))
plain = Qos(reliable, Policy.History.KeepLast(10), Policy.DataRepresentation(use_cdrv0_representation=True))
frames = DataWriter(participant, Topic(participant, "rt/sweepd/transforms", make("sweepd_msgs/msg/BodyTransforms")), qos=plain)
pairs = DataReader(participant, Topic(participant, "rt/sweepd/pairs", make("sweepd_msgs/msg/Pairs")), qos=Qos(reliable, Policy.History.KeepLast(10)))
waitset = WaitSet(participant)
waitset.attach(ReadCondition(pairs, ANY))

frame = zero("sweepd_msgs/msg/BodyTransforms")
fill(frame, lambda: zero("sweepd_msgs/msg/BodyTransform"), bodies, SEED, second=2)
encoded = EncodedFrame(frame, frame.serialize(use_version_2=False), SEED)


def sample(number):
    """One frame, each body moved; microseconds until its pairs."""
    moved, wanted = encoded.next(number)
    frame.serialize = lambda use_version_2: moved
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
