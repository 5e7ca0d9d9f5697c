"""Rows of shared memory and messages of ROS 2, compared field by field. Each function returns what differs."""

import math
import struct

from sweepd import layout

BOOT = "boot_id tick scene_rev oldest_stamp_ns newest_stamp_ns truncated state".split()
TICK = """sent_ns elapsed_ns budget_ns budget_units floor_ns units bodies unknown candidates colliding possible near ignored
missed cancelled_events worst_a worst_b widest_m oldest_undecided_ticks reasons cause overrun cause_source rebuilds broad_renewed broad_mode broad_cause""".split()
SOURCE = "session epoch seq stamp_ns clock_id age_ns frames skipped refused alive paused".split()
PAIR = """body_a body_b gap_min_m gap_max_m gap_best_m closing_mps toi_min toi_max begin_first_tick
begin_last_tick end_first_tick end_last_tick certified_tick bound_age_ticks verdict certified_verdict events end_cause level flags""".split()
CONTACT = "id body_a body_b gap_m gap_min_m gap_max_m shape_a shape_b triangle_a triangle_b flags kind".split()
POINTS = "point_a point_b point_a_body point_b_body normal".split()


def same(row, message):
    """Bit for bit; what is not a number is what is not a number."""
    if isinstance(row, float) or isinstance(message, float):
        return struct.pack("d", row) == struct.pack("d", message) or (math.isnan(row) and math.isnan(message))
    return int(row) == int(message)


def text(chars):
    return bytes(chars).split(b"\0")[0].decode()


def fields(row, message, names, where):
    get = (lambda name: row[name]) if hasattr(row, "dtype") else (lambda name: getattr(row, name))
    out = []
    for name in names:
        ours, theirs = get(name), getattr(message, name)
        ours = ours.item() if hasattr(ours, "item") else ours
        if not same(ours, theirs):
            out.append(f"{where}.{name}: {ours} in shared memory, {theirs} in ROS 2")
    return out


def header(row, message, where):
    """The repeated header, and `header.stamp` as the oldest stamp."""
    out = fields(row, message.tick_header, BOOT, where)
    stamp = message.header.stamp
    if stamp.sec * 10**9 + stamp.nanosec != row.oldest_stamp_ns:
        out.append(f"{where}.header.stamp: {stamp} for {row.oldest_stamp_ns}")
    return out


def tick(row, message):
    out = header(row.header, message, "tick") + fields(row, message, TICK, "tick")
    for name in ("stage_ns", "rejects"):
        if list(getattr(row, name)) != list(getattr(message, name)):
            out.append(f"tick.{name}: {list(getattr(row, name))} and {list(getattr(message, name))}")
    rows = row.sources[: row.sources_len]
    if [text(one.name) for one in rows] != [one.name for one in message.sources]:
        return [*out, f"tick.sources: {message.sources}"]
    for one, other in zip(rows, message.sources):
        out += fields(one, other, SOURCE, f"tick.sources[{other.name}]")
    return out


def state(row, message, names):
    out = header(row.header, message, "state") + fields(row, message, ["reasons", "worst_a", "worst_b"], "state")
    words = {layout.State(row.header.state).name.lower(): message.word}
    words |= {names.get(row.worst_a, ""): message.worst_name_a, names.get(row.worst_b, ""): message.worst_name_b}
    out += [f"state: {ours!r} is said as {theirs!r}" for ours, theirs in words.items() if ours != theirs]
    reasons = [reason.name.lower() for reason in layout.Reason if row.reasons & (1 << reason)]
    if reasons != list(message.reason_words):
        out.append(f"state.reason_words: {message.reason_words} for {reasons}")
    return out


def listed(rows, messages, names, plain, points=()):
    """Rows of one tick, over all its chunks."""
    if len(rows) != len(messages):
        return [f"{len(rows)} rows in shared memory, {len(messages)} in ROS 2"]
    out = []
    for place, (row, message) in enumerate(zip(rows, messages)):
        out += fields(row, message, plain, f"[{place}]")
        for name in points:
            point = getattr(message, name)
            if any(not same(a, b) for a, b in zip(row[name].tolist(), (point.x, point.y, point.z))):
                out.append(f"[{place}].{name}: {row[name]} and {point}")
        for body, name in ((message.body_a, message.name_a), (message.body_b, message.name_b)):
            if names.get(body) != name:
                out.append(f"[{place}]: body {body} is {names.get(body)!r}, not {name!r}")
    return out


def whole(messages):
    """The messages of chunked topics by tick: `{(boot_id, tick): rows}` where all chunks have come."""
    parts = {}
    for message in messages:
        head = message.tick_header
        parts.setdefault((head.boot_id, head.tick), {})[message.chunk_index] = message
    out = {}
    for key, chunks in parts.items():
        if len(chunks) == chunks[min(chunks)].chunk_count:
            rows = [getattr(chunks[place], "pairs", None) or getattr(chunks[place], "contacts", []) for place in sorted(chunks)]
            out[key] = [row for chunk in rows for row in chunk]
    return out
