"""Frames of poses as a ROS 2 sender writes them."""

import secrets
import time

from geometry_msgs.msg import Point, Pose, Quaternion
from sweepd_msgs.msg import BodyTransform, BodyTransforms


def pose(position, orientation=(0.0, 0.0, 0.0, 1.0)):
    """A pose from x, y, z and x, y, z, w."""
    (x, y, z), (qx, qy, qz, qw) = map(float, position), map(float, orientation)
    return Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(x=qx, y=qy, z=qz, w=qw))


class Sender:
    """One session of a source on `~/transforms`."""

    def __init__(self, node, source="sim", topic="/sweepd/transforms", qos=10):
        self.session = secrets.randbits(64) or 1
        self.epoch = 0
        self.seq = 0
        self._source = source
        self._node = node
        self.publisher = node.create_publisher(BodyTransforms, topic, qos)

    def frame(self, poses, flags=BodyTransforms.FULL, stamp_ns=None, **more):
        """The next frame: `{name or id: position or (position, orientation)}`."""
        self.seq += 1
        message = BodyTransforms(
            source=self._source,
            session=self.session,
            epoch=self.epoch,
            seq=self.seq,
            sent_ns=time.clock_gettime_ns(time.CLOCK_BOOTTIME),
            flags=flags,
            **more,
        )
        stamp_ns = time.time_ns() if stamp_ns is None else stamp_ns
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, 10**9)
        message.header.frame_id = "world"
        for body, place in poses.items():
            placed = pose(*place) if len(place) == 2 else pose(place)
            which = {"name": body} if isinstance(body, str) else {"body": body}
            message.transforms.append(BodyTransform(pose=placed, **which))
        return message

    def send(self, poses, **more):
        """Sends the next frame and returns its number."""
        self.publisher.publish(self.frame(poses, **more))
        return self.seq
