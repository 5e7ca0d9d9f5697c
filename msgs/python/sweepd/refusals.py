"""Why a frame has no result and what to do about it, as far as ticks say."""

from . import layout
from .layout import RejectReason

#: What to do about each reason; ``{source}`` is that of the frame.
REMEDIES = {
    RejectReason.NOT_FINITE: "send no NaN and no infinity",
    RejectReason.BAD_QUATERNION: "make quaternions of length 1",
    RejectReason.UNKNOWN_BODY: "look the ids up in `client.names`",
    RejectReason.WRONG_SOURCE: "let the source that the scene names for the body send it",
    RejectReason.UNKNOWN_SOURCE: "name a source of the scene, or write [[source]] into it",
    RejectReason.SOURCE_TAKEN: "another client sends as `{source}`: end that one, or open this one with another source",
    RejectReason.SESSION_OVER: "another client has sent as `{source}` since, or the daemon has restarted: open a new client, and"
    " let one alone send",
    RejectReason.OLD_FRAME: "a newer one of this client was there before it: send from one thread",
    RejectReason.SCENE_REVISION: "send the edit first, or a smaller `scene_rev`",
    RejectReason.BAD_LAYOUT: "use the same version of sweepd on both sides; of vertices send as many as the body has",
    RejectReason.DUPLICATE: "name each body once in a frame",
    RejectReason.NOT_STEERABLE: "leave out bodies that cannot move, or that hang on another, and vertices of those that do not deform",
    RejectReason.TOO_OLD: "send it again",
    RejectReason.OVER_LIMIT: "send fewer rows, or coordinates nearer to the origin",
    RejectReason.BAD_CHAIN: "see what the ROS 2 node says",
    RejectReason.VERTEX_VERSION: "send all vertices of the body again",
}


def text(chars):
    """Characters of a row as a string."""
    return bytes(chars).split(b"\0")[0].decode("utf-8", "replace")


def source_row(tick, source):
    """The row of a source in a tick; None if the scene has no such source."""
    for row in tick.sources[: tick.sources_len]:
        if text(row.name) == source:
            return row
    return None


def why_no_result(tick, before, source, scene_rev):
    """What the ticks from ``before`` (None: the first) to ``tick`` say that may explain it, each after a semicolon."""
    told = []
    row = source_row(tick, source)
    if is_under_way(tick):
        told.append("a tick is still under way")
    elif row is None:
        known = ", ".join(text(row.name) for row in tick.sources[: tick.sources_len])
        told.append(f"the scene has no such source, it has: {known}")
    elif scene_rev > tick.header.scene_rev:
        told.append(
            f"it waits for revision {scene_rev} of the scene (`scene_rev`), which is at {tick.header.scene_rev}; an edit"
            " makes the next"
        )
    for reason, remedy in REMEDIES.items():
        refused = tick.rejects[reason] - (before.rejects[reason] if before else 0)
        if refused > 0:
            told.append(f"{refused} refused as {reason.name.lower()} ({remedy.format(source=source)})")
    return "".join(f"; {words}" for words in told)


def is_under_way(tick):
    """Whether a tick is still under way: it takes longer than a heartbeat, and nothing belongs to this report of it."""
    # no tick that has ended says so: undecided pairs alone are no reason for unknown
    return tick.header.state == layout.State.UNKNOWN and tick.reasons == 1 << layout.Reason.UNDECIDED
