"""An rclpy node that moves the two robots of robots.toml through each other: `a` by ~/transforms, `b` by /tf.

    python move_robots.py [--seconds N] [--node NAME] [--same-host]
"""

import math
import secrets
import time

import rclpy
from arguments import arguments, begin
from geometry_msgs.msg import TransformStamped
from sweepd_msgs.msg import BodyTransform, BodyTransforms
from tf2_msgs.msg import TFMessage

RATE_HZ = 50.0
# One pass from side to side, seconds.
PASS_S = 6.0


def about_y(angle):
    """A turn about y as x, y, z, w."""
    return 0.0, math.sin(angle / 2), 0.0, math.cos(angle / 2)


def links(side, elapsed):
    """The links of the robot that starts on this side (-1 or 1): name, parent, position in the parent, turn there."""
    x = side * 1.5 * math.cos(math.pi * elapsed / PASS_S)
    swing = 0.4 * math.sin(1.3 * elapsed + side)
    return [
        ("base", "world", (x, 0.05 * side, 0.3), about_y(0.0)),
        ("arm", "base", (0.0, 0.0, 0.45), about_y(swing)),
        ("hand", "arm", (0.0, 0.0, 0.45), about_y(0.0)),
    ]


def chained(robot, all_links):
    """The same links in the world: this demo turns about y only, so angles add."""
    where = {"world": ((0.0, 0.0, 0.0), 0.0)}
    for name, parent, (x, y, z), (_, qy, _, qw) in all_links:
        (px, py, pz), angle = where[parent]
        at = (px + x * math.cos(angle) + z * math.sin(angle), py + y, pz - x * math.sin(angle) + z * math.cos(angle))
        where[name] = (at, angle + 2 * math.atan2(qy, qw))
        yield f"{robot}/{name}", at, about_y(where[name][1])


def write(pose_position, pose_orientation, at, turn):
    pose_position.x, pose_position.y, pose_position.z = at
    pose_orientation.x, pose_orientation.y, pose_orientation.z, pose_orientation.w = turn


def main():
    args = arguments()
    over = begin()
    node = rclpy.create_node("move_robots")
    frames = node.create_publisher(BodyTransforms, f"/{args.node}/transforms", 1)
    tf = node.create_publisher(TFMessage, "/tf", 10)
    frame = BodyTransforms(source="robot_a", session=secrets.randbits(63) + 1, flags=BodyTransforms.FULL)
    frame.header.frame_id = "world"
    start = time.monotonic()
    while not over and (elapsed := time.monotonic() - start) < args.seconds:
        now = node.get_clock().now().to_msg()
        # Robot a: all its bodies in one message, in the fixed frame.
        frame.header.stamp = now
        frame.seq += 1
        # The clock of the machine that sweepd runs on: elsewhere nobody has it, and ages count from receipt.
        frame.sent_ns = time.clock_gettime_ns(time.CLOCK_BOOTTIME) if args.same_host else 0
        frame.transforms = []
        for name, at, turn in chained("a", links(-1, elapsed)):
            body = BodyTransform(name=name)
            write(body.pose.position, body.pose.orientation, at, turn)
            frame.transforms.append(body)
        frames.publish(frame)
        # Robot b: links between frames, as a robot state publisher sends them.
        message = TFMessage()
        for name, parent, at, turn in links(1, elapsed):
            link = TransformStamped(child_frame_id=f"b/{name}")
            link.header.stamp = now
            link.header.frame_id = parent if parent == "world" else f"b/{parent}"
            write(link.transform.translation, link.transform.rotation, at, turn)
            message.transforms.append(link)
        tf.publish(message)
        # A timer would do; this program has nothing else to serve.
        time.sleep(max(0.0, start + frame.seq / RATE_HZ - time.monotonic()))


if __name__ == "__main__":
    main()
