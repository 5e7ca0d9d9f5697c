"""Scenes of the ROS 2 tests."""

# Two robots' hands over a floor, moved by one source, frame by frame.
HANDS = """
frame_id = "world"
[run]
on_frame = "sim"
[[source]]
name = "sim"
timeout_ms = 500
[[body]]
name = "left"
shape = { type = "sphere", radius = 0.5 }
[[body]]
name = "right"
report_within_m = 0.2
shape = { type = "box", half_extents = [0.5, 0.5, 0.5] }
[[body]]
name = "floor"
moves = false
shape = { type = "half_space", normal = [0.0, 0.0, 1.0], offset = -10.0 }
"""


def cloud(count, run='on_frame = "sim"', timeout_ms=2000, radius=0.5, limits=""):
    """Spheres `b0000`.. of one source."""
    bodies = "".join(
        f'[[body]]\nname = "b{n:04}"\nshape = {{ type = "sphere", radius = {radius} }}\n' for n in range(count)
    )
    return f'frame_id = "world"\n[run]\n{run}\n{limits}\n[[source]]\nname = "sim"\ntimeout_ms = {timeout_ms}\n{bodies}'
