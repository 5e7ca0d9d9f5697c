"""The scene file: every collidable geom a body, MuJoCo's filters as groups and rules, one source in lockstep.

In: a compiled model and its data at the start. Out: TOML text, and the order of bodies that poses are sent in.
"""

import numpy as np

from . import filters, shapes
from .model import Refused, collidable, geom_title

SOURCE = "mujoco"
"""Name of the one source."""


class Scene:
    """What the daemon is told of a model.

    geoms: `[n]` MuJoCo ids. names: `[n]` of str. ids: `[n]` sweepd body ids, geom id + 1. moving: `[n]` of bool.
    allowed: `[n, n]` of bool, MuJoCo's pairs. lost: pairs of names that MuJoCo would check and sweepd never does.
    """

    def __init__(self, model):
        self.model = model
        self.geoms = collidable(model)
        if not len(self.geoms):
            raise Refused("no geom of this model can collide: there is nothing to check")
        self.shapes = [shapes.shape_of(model, int(geom)) for geom in self.geoms]
        self.names = filters.names_of(model, self.geoms)
        self.ids = self.geoms.astype(np.int64) + 1
        self.filters = filters.filters_of(model, self.geoms, self.names)
        self.moving = ~np.array(self.filters["still"], dtype=bool)
        self.allowed = filters.allowed_by_mujoco(model, self.geoms)
        self.lost = self.check_filters()

    def check_filters(self):
        """Reads the filters back by sweepd's law. Two bodies that cannot move are the only pairs that may be lost."""
        reached = filters.allowed_by_scene(self.filters, self.names)
        still = ~self.moving
        differs = np.triu(self.allowed != reached)
        expected = still[:, None] & still[None] & self.allowed
        if (differs & ~expected).any():
            k, m = np.argwhere(differs & ~expected)[0]
            raise Refused(f"the filters for {self.names[k]} and {self.names[m]} cannot be said in a scene: report this")
        self.allowed = self.allowed & ~expected
        return [(self.names[k], self.names[m]) for k, m in np.argwhere(differs)]

    def poses(self, data):
        """`[n, 7]`: position in metres, quaternion w, x, y, z of every body, in the order of `names`."""
        poses = np.empty((len(self.geoms), 7))
        poses[:, :3] = data.geom_xpos[self.geoms]
        for row, geom in enumerate(self.geoms):
            poses[row, 3:] = shapes.mat_to_quat(data.geom_xmat[geom])
        return poses

    def text(self, data, title, heading):
        """The scene file. `heading`: lines of `[run]`, such as a budget."""
        poses = self.poses(data)
        lines = [f"# {title}: written by mujoco_bridge.py, each geom a body.", 'frame_id = "world"', "", "[run]"]
        lines += [f'on_frame = "{SOURCE}"', *heading, "", "[[source]]", f'name = "{SOURCE}"', "timeout_ms = 5000"]
        for k, name in enumerate(self.names):
            lines += ["", "[[body]]", f"name = {quoted(name)}", f"id = {self.ids[k]}"]
            lines.append(f"position = {numbers(poses[k, :3])}")
            lines.append(f"orientation = {numbers(np.roll(poses[k, 3:], -1))}")
            if self.moving[k]:
                lines.append(f'source = "{SOURCE}"')
            else:
                lines.append("moves = false")
            lines.append(f"group = {self.filters['group'][k]:#x}")
            lines.append(f"mask = {self.filters['mask'][k]:#x}")
            if self.filters["rigid_group"][k]:
                lines.append(f"rigid_group = {quoted(self.filters['rigid_group'][k])}")
            lines.append(f"shape = {inline(self.shapes[k])}")
        for entry in self.filters["rules"]:
            lines += ["", "[[rule]]"] + [f"{key} = {quoted(value)}" for key, value in entry.items()]
        return "\n".join(lines) + "\n"

    def title(self, place):
        """A body as MuJoCo knows it."""
        return geom_title(self.model, int(self.geoms[place]))


def number(value):
    """A float that TOML reads back bit for bit."""
    return repr(float(value))


def numbers(values):
    """A list of floats."""
    return "[" + ", ".join(number(v) for v in values) + "]"


def inline(shape):
    """A shape as an inline table."""
    parts = []
    for key, value in shape.items():
        if isinstance(value, str):
            text = quoted(value)
        elif isinstance(value, bool):
            text = str(value).lower()
        elif key == "faces":
            text = repr(value)
        elif isinstance(value, float):
            text = number(value)
        elif value and isinstance(value[0], list):
            text = "[" + ", ".join(numbers(row) for row in value) + "]"
        else:
            text = numbers(value)
        parts.append(f"{key} = {text}")
    return "{ " + ", ".join(parts) + " }"


def quoted(text):
    """A TOML string. Names were freed of quotes and control characters before."""
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
