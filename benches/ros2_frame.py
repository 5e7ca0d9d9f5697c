"""A `sweepd_msgs/msg/BodyTransforms` encoded once, whose numbers are changed in place; and the stamp of an encoded answer.

For the peers of ros2_latency.py that cost little: they neither build nor read messages while time is taken.
"""

import random
import struct
import time

# Numbers that stand for those of the next frame while their places are looked for.
SEQ, SENT_NS, NANOSEC = 0x1122334455667788, 0x1222334455667789, 0x13223344
STEP = 5e-3


def fill(frame, zero_body, bodies, seed, second):
    """Fills a frame whose class is the caller's; `zero_body()` makes a BodyTransform. Stamps lie in `second`."""
    dice = random.Random(seed)
    frame.source, frame.session, frame.flags, frame.header.frame_id = "sim", dice.getrandbits(60) | 1, 1, "world"
    frame.header.stamp.sec, frame.header.stamp.nanosec, frame.seq, frame.sent_ns = second, NANOSEC, SEQ, SENT_NS
    for number in range(bodies):
        body = zero_body()
        body.name, body.pose.orientation.w = f"b{number}", 1.0
        body.pose.position.x, body.pose.position.y, body.pose.position.z = (dice.uniform(0, 4) for _ in range(3))
        frame.transforms.append(body)


class EncodedFrame:
    """The bytes of a filled frame, as they go over the wire."""

    def __init__(self, frame, encoded, seed):
        self.bytes = bytearray(encoded)
        self.dice = random.Random(seed)
        place = lambda how, value: self.bytes.index(struct.pack(how, value))  # noqa: E731
        self.seq_at, self.sent_at, self.nanosec_at = place("<Q", SEQ), place("<Q", SENT_NS), place("<I", NANOSEC)
        self.xs = [body.pose.position.x for body in frame.transforms]
        self.xs_at = [place("<d", x) for x in self.xs]
        self.second = frame.header.stamp.sec

    def next(self, number):
        """The frame of a number, each body moved by some millimetres; and the stamp of its answer, nanoseconds."""
        for n, at in enumerate(self.xs_at):
            self.xs[n] += self.dice.uniform(-STEP, STEP)
            struct.pack_into("<d", self.bytes, at, self.xs[n])
        struct.pack_into("<Q", self.bytes, self.seq_at, number)
        struct.pack_into("<I", self.bytes, self.nanosec_at, number)
        struct.pack_into("<Q", self.bytes, self.sent_at, time.clock_gettime_ns(time.CLOCK_BOOTTIME))
        return bytes(self.bytes), self.second * 10**9 + number


def stamp_of(raw):
    """`newest_stamp_ns` of an encoded message with a `TickHeader` behind its header: pairs, state or tick."""
    at = 12
    at += 4 + struct.unpack_from("<I", raw, at)[0]
    tick_header_at = 4 + (at - 4 + 7) // 8 * 8
    return struct.unpack_from("<Q", raw, tick_header_at + 32)[0]
