"""What a frame is made of: rows that know for which daemon they were made, and numbers that fit their fields."""

import operator

import numpy as np

from . import layout
from .errors import SweepdError

POSE = np.dtype(layout.TransformRow)
MOVING = np.dtype(layout.TransformVelRow)


class Rows(np.ndarray):
    """An array of rows, its copies and its parts; the ids in it are those of one start of the daemon."""

    #: Boot id of that start; 0: not known.
    boot_id = 0

    def __array_finalize__(self, made_from):
        self.boot_id = getattr(made_from, "boot_id", 0)


def rows_of(ids, columns, wxyz):
    """Rows from columns: positions, quaternions, and of a frame with velocities linear and angular ones."""
    if len(columns) not in (2, 4):
        raise SweepdError("a pose is a position and a quaternion, or these, a linear and an angular velocity")
    moving = len(columns) == 4
    rows = np.zeros(len(ids), MOVING if moving else POSE)
    pose = rows["transform"] if moving else rows
    pose["body"] = ids
    if len(ids):
        quaternions = np.asarray(columns[1], dtype=np.float64)
        pose["position"] = columns[0]
        pose["orientation"] = np.roll(quaternions, -1, axis=-1) if wxyz else quaternions
        if moving:
            rows["linear"], rows["angular"] = columns[2:]
    return rows.view(Rows)


def columns_of(poses):
    """The columns of ``{name: pose}``."""
    kinds = {len(pose) for pose in poses.values()} or {2}
    if len(kinds) > 1:
        raise SweepdError("a frame has velocities of all its bodies, or of none")
    return [[pose[at] for pose in poses.values()] for at in range(kinds.pop())]


def whole(name, value, bits=64):
    """A number for an unsigned field: ctypes would take -1 as the largest there is."""
    try:
        number = operator.index(value)
    except TypeError:
        raise SweepdError(f"{name}={value!r}: give a whole number") from None
    if not 0 <= number < 1 << bits:
        raise SweepdError(f"{name}={number}: give 0 to 2^{bits} - 1")
    return number


def time_left(value):
    """Late is not without a limit: less than nothing left is sent as the least there is, 1 ns; 0 says nothing."""
    return 1 if value < 0 else whole("time_left_ns", value)
