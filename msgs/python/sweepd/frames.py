"""The parts of a frame: rows that know which daemon they were made for, and numbers that fit their fields."""

import math
import operator

import numpy as np

from . import layout
from .errors import SweepdError, TimedOut

POSE = np.dtype(layout.TransformRow)
MOVING = np.dtype(layout.TransformVelRow)
#: Rows that the daemon takes in a frame.
_ROWS_MAX = 1 << 20


class Rows(np.ndarray):
    """An array of rows, and its copies and parts; its ids are those of one start of the daemon."""

    #: Boot id of that start; 0: not known.
    boot_id = 0

    def __array_finalize__(self, made_from):
        self.boot_id = getattr(made_from, "boot_id", 0)


def rows_of(ids, columns, wxyz, names=None):
    """Rows from columns: positions and quaternions, and for a frame with velocities also linear and angular ones.

    ``names`` of the bodies, if given, are used to report a pose that does not fit.
    """
    if len(columns) not in (2, 4):
        raise SweepdError("a pose is a position and a quaternion, or these, a linear and an angular velocity")
    moving = len(columns) == 4
    ids = _ids(ids)
    bodies = range(len(ids)) if names is None else names
    columns = [_column(*column, values, bodies) for column, values in zip(_COLUMNS, columns)]
    rows = np.zeros(len(ids), MOVING if moving else POSE)
    pose = rows["transform"] if moving else rows
    pose["body"] = ids
    pose["position"] = columns[0]
    pose["orientation"] = np.roll(columns[1], -1, axis=-1) if wxyz else columns[1]
    if moving:
        rows["linear"], rows["angular"] = columns[2:]
    return rows.view(Rows)


def blank(count, moving):
    """Rows without poses: a row that is not written is refused by the daemon, and is never a pose left in memory."""
    count = whole("count", count)
    if count > _ROWS_MAX:
        raise SweepdError(f"count={count}: a frame has at most {_ROWS_MAX} rows")
    rows = np.zeros(count, MOVING if moving else POSE)
    (rows["transform"] if moving else rows)["position"] = np.nan
    return rows.view(Rows)


_COLUMNS = (("position", 3), ("quaternion", 4), ("linear velocity", 3), ("angular velocity", 3))


def _ids(ids):
    """Ids as whole numbers: numpy would cut 1.9, and take -1 as the largest there is."""
    found = array("ids", ids)
    if found.ndim != 1:
        raise SweepdError(f"ids of shape {found.shape}: give (n,)")
    if found.dtype.kind in "fO":
        # a list that is empty, or has ids on both sides of 2^63, is one of float64 to numpy
        return np.array([whole(f"ids[{at}]", id_) for at, id_ in enumerate(ids)], np.uint64)
    if found.dtype.kind not in "iu":
        raise SweepdError(
            f"ids of dtype {found.dtype}: give whole numbers, as `client.names` has them, or poses by name as a dict"
        )
    if found.dtype.kind == "i" and len(found) and found.min() < 0:
        at = int(found.argmin())
        raise SweepdError(f"ids[{at}]={found[at]}: give 0 to 2^64 - 1")
    return found


def _column(what, width, values, bodies):
    """A column of real numbers with a row of ``width`` for each body: numpy would spread fewer over all."""
    count = len(bodies)
    try:
        found = array(what, values)
    except SweepdError:
        found = None
    if found is not None:
        if not count and not found.size:
            return np.empty((0, width))
        if found.dtype.kind in "fiu" and found.shape == (count, width):
            return found
    if isinstance(values, (list, tuple)) and len(values) == count:
        # it is told which one does not fit
        for body, value in zip(bodies, values):
            one = array(f"{what} of body {body!r}", value)
            if one.shape != (width,) or one.dtype.kind not in "fiu":
                raise SweepdError(f"{what} of body {body!r} is {_short(value)}: give {width} real numbers within float64")
    told = "of no shape" if found is None else f"of shape {found.shape} and dtype {found.dtype}"
    raise SweepdError(f"{what} {told}: give real numbers of shape ({count}, {width}), a row for each body")


def _short(value):
    try:
        text = repr(value)
    except Exception:
        # Python refuses to write whole numbers of thousands of digits
        text = f"some {type(value).__name__}"
    return text if len(text) <= 80 else f"{text[:77]}..."


def array(what, values):
    """What was given, as a numpy array of any kind."""
    try:
        return np.asarray(values)
    except Exception as e:
        # objects of others say in their own ways that they are no arrays
        raise SweepdError(f"{what}: these are no array of numbers ({e})") from e


def columns_of(poses):
    """The columns of ``{name: pose}``."""
    try:
        kinds = {len(pose) for pose in poses.values()} or {2}
    except TypeError:
        raise SweepdError("a pose is a position and a quaternion: give {name: (position, quaternion)}") from None
    if len(kinds) > 1:
        raise SweepdError("a frame has velocities of all its bodies, or of none")
    try:
        return [[pose[at] for pose in poses.values()] for at in range(kinds.pop())]
    except (TypeError, LookupError):
        raise SweepdError("a pose is a tuple of a position and a quaternion") from None


def whole(name, value, bits=64):
    """A number for an unsigned field: ctypes would take -1 as the largest value."""
    try:
        number = operator.index(value)
    except TypeError:
        raise SweepdError(f"{name}={_short(value)}: give a whole number") from None
    if not 0 <= number < 1 << bits:
        raise SweepdError(f"{name}={_short(number)}: give 0 to 2^{bits} - 1")
    return number


def time_left(value):
    """Late does not mean without a limit: less than 0 is sent as the least value, 1 ns; 0 says nothing."""
    try:
        late = bool(value < 0)
    except (TypeError, ValueError):
        late = False
    return 1 if late else whole("time_left_ns", value)


def seconds_to_send(timeout_s):
    """As ``seconds``, but raises TimedOut if the time is already over, so that nothing is sent."""
    left = seconds(timeout_s)
    if left < 0:
        raise TimedOut(f"timeout_s={left}: the time was over before anything was sent, and nothing was")
    return left


def seconds(timeout_s):
    """A time to wait; below 0 it is over. NaN is refused: it never is, and would end the process within iceoryx2."""
    try:
        unfit = math.isnan(timeout_s)
    except (TypeError, ValueError, OverflowError):
        unfit = True
    if unfit:
        raise SweepdError(f"timeout_s={_short(timeout_s)}: give a number of seconds")
    return float(timeout_s)
