"""Open files of this process and room in shared memory: without them a client fails under other causes, or dies."""

import errno
import os
import resource

from .errors import Refused

#: Files that a client may open beside those that its process has: one that listens to pairs and contacts and sends takes 48.
_LEAST = 56
#: With fewer left a port that cannot be opened lacks them.
_FEW = 16
#: Where shared memory lies, and what must be free there for a client's ports, bytes: as the Rust client has it.
_SHARED, _SHARED_LEAST = "/dev/shm", 256 << 10


def _left():
    """How many more this process may open, how many it has and may have; None: there is no limit, or it is not known."""
    most, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    if most == resource.RLIM_INFINITY:
        return None
    try:
        # what lists them is one itself
        count = len(os.listdir("/proc/self/fd")) - 1
    except OSError as e:
        if e.errno != errno.EMFILE:
            return None
        count = most
    # what was inherited may be beyond the limit
    count = min(count, most)
    return most - count, count, most


def _told(count, most):
    mend = f"`ulimit -n {max(2 * most, 1024)}` in the shell that starts it, or `resource.setrlimit` in it"
    return f"this process has {count} of the {most} files open that it may", mend


def check():
    """Raises Refused if this process may not open enough more files for a client."""
    left = _left()
    if left is not None and left[0] < _LEAST:
        has, mend = _told(*left[1:])
        raise Refused(f"{has}, and a client of a daemon takes up to {_LEAST} more: {mend}")


def check_room():
    """Raises Refused if shared memory has too little room: writing beyond its end would end this process (SIGBUS)."""
    try:
        room = os.statvfs(_SHARED)
    except OSError:
        return
    free = room.f_bavail * room.f_frsize
    # without a limit it says 0 of all
    if room.f_blocks and free < _SHARED_LEAST:
        raise Refused(
            f"{_SHARED} has {free >> 10} KiB free, and a client takes up to {_SHARED_LEAST >> 10} KiB when it starts; who writes beyond"
            f" the end is killed (SIGBUS): make it larger (in a container `--shm-size=64m`, else"
            f" `mount -o remount,size=64m {_SHARED}`), or remove what fills it"
        )


def short():
    """What keeps this process from opening ports, in words; None if it is not the number of its open files."""
    left = _left()
    if left is None or left[0] >= _FEW:
        return None
    has, mend = _told(*left[1:])
    return f"{has}: {mend}"
