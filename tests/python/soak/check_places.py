"""Contacts lie on both surfaces, and regions hold what two bodies share."""

from __future__ import annotations

from typing import Iterator, Optional

import numpy as np
from sweepd.layout import ContactFlags, ContactKind, RegionFlags, Verdict

from .faults import Fault
from .moment import Moment
from .shapes import Part, turned
from .told import ids_of

#: Points are worked out from rounded poses and shapes, metres.
_NEAR_M = 1e-9
#: Corners of a manifold are cut at the edges of both faces: so far beside them one may be, metres.
_CUT_M = 1e-7


def check_contacts(now: Moment) -> Iterator[Fault]:
    """Rows of contacts belong to a pair that collides or is near, and say where."""
    rows = now.told.contacts
    if rows is None or now.list is None:
        return
    ids = [int(row["id"]) for row in rows if int(row["kind"]) == ContactKind.CONTACT]
    if len(set(ids)) != len(ids) or 0 in ids:
        yield Fault("contact", now.tick, "contacts", f"ids {sorted(ids)}", "each has one of its own, and none is 0")
    for row in rows:
        wrong = _wrong_contact(now, row)
        if wrong is not None:
            text = f"{ContactKind(int(row['kind'])).name.lower()} {row['id']}: a {row['point_a']}, b {row['point_b']}"
            text += f", normal {row['normal']}, gap {float(row['gap_m'])!r} m, flags {row['flags']}"
            yield Fault("contact", now.tick, now.who_by_ids(ids_of(row)), text, wrong)
    if now.told.tick.header.truncated == 0:
        yield from _check_closest(now, rows)


def _check_closest(now: Moment, rows: np.ndarray) -> Iterator[Fault]:
    """A pair has the closest points once at most, and without id."""
    closest = [ids_of(row) for row in rows if int(row["kind"]) == ContactKind.CLOSEST]
    if len(set(closest)) != len(closest) or any(
        int(row["id"]) for row in rows if int(row["kind"]) == ContactKind.CLOSEST
    ):
        yield Fault("contact", now.tick, "contacts", f"closest points of {closest}", "one of a pair, whose id is 0")


def _wrong_contact(now: Moment, row: np.void) -> Optional[str]:
    pair = now.by_ids.get(ids_of(row))
    kind = ContactKind(int(row["kind"]))
    wanted = Verdict.COLLIDING if kind == ContactKind.CONTACT else Verdict.NEAR
    if pair is None:
        return None if now.told.tick.header.truncated else "its pair is not listed"
    if int(pair["verdict"]) != wanted:
        return f"its pair is {Verdict(int(pair['verdict'])).name.lower()}"
    normal, apart = np.array(row["normal"]), np.array(row["point_b"]) - np.array(row["point_a"])
    gap = float(row["gap_m"])
    if abs(np.linalg.norm(normal) - 1.0) > _NEAR_M:
        return "a unit normal"
    a, b = (now.place[id_] for id_ in ids_of(row))
    if not (now.placed[a] and now.placed[b]):
        return None
    estimate = bool(int(row["flags"]) & ContactFlags.ESTIMATE)
    sides = [("a", a)] if estimate else [("a", a), ("b", b)]
    for side, at in sides:
        position, orientation = now.pose_of(at)  # type: ignore[misc]
        of_body = turned(np.array([orientation]), np.array([row[f"point_{side}_body"]]))[0]
        off = np.abs(np.array(position) + of_body - np.array(row[f"point_{side}"])).max()
        if off > _NEAR_M:
            return f"point_{side}_body at the pose of the tick is {off} m beside point_{side}"
    if estimate:
        return None
    if abs(float(apart @ normal) - gap) > _NEAR_M:
        return f"along the normal its points are {float(apart @ normal)!r} m apart"
    for side, at in sides:
        off = _off_surface(now, at, np.array(row[f"point_{side}"]), int(row[f"shape_{side}"]))
        if off > _CUT_M:
            return f"point_{side} is {off!r} m off the surface"
    if not float(row["gap_min_m"]) <= float(row["gap_max_m"]):
        return "an interval"
    return None


def _off_surface(now: Moment, at: int, point: np.ndarray, shape: int) -> float:
    body = now.body(at)
    assert body is not None
    if body.plane is not None:
        return abs(float(np.array(body.plane.normal) @ point) - body.plane.offset_m)
    parts = now.scene.forms.parts_of(int(now.order[at]))
    if not 0 <= shape < parts.stop - parts.start:
        return float("inf")
    apart = point - now.centres[parts.start + shape]
    part: Part = body.parts[shape]
    if not part.is_box:
        return abs(float(np.linalg.norm(apart)) - part.radius_m)
    over = np.abs(apart) - np.array(part.half_m)
    return abs(float(np.linalg.norm(np.maximum(over, 0.0)) + min(over.max(), 0.0)))


def check_regions(now: Moment) -> Iterator[Fault]:
    """What two bodies share for certain is in the regions of their pair, or if those are complete each contact is."""
    rows = now.told.regions
    if rows is None or now.list is None or now.told.tick.header.truncated:
        return
    with np.errstate(invalid="ignore"):
        sharing = now.allowed & now.placed[:, None] & now.placed[None] & (now.gaps < -_NEAR_M)
    for b, a in np.argwhere(sharing & np.tri(len(now.names), k=-1, dtype=bool)):
        ids = int(now.rows["body"][a]), int(now.rows["body"][b])
        own = rows[(rows["body_a"] == ids[0]) & (rows["body_b"] == ids[1])]
        complete = len(own) > 0 and bool(int(own["flags"][0]) & RegionFlags.COMPLETE)
        for point in _touched(now, ids) if complete else _shared(now, int(a), int(b)):
            away = np.linalg.norm(own["centre"] - point, axis=1) - own["radius_m"]
            if not (away <= _NEAR_M).any():
                told = f"{len(own)} regions, the nearest {float(away.min(initial=np.inf))!r} m away"
                yield Fault("region", now.tick, now.who(int(a), int(b)), told, f"they share {point}")
    counts = {}
    for row in rows:
        counts.setdefault(ids_of(row), []).append((int(row["index"]), int(row["count"])))
    for ids, places in counts.items():
        if places != [(at, len(places)) for at in range(len(places))] or len(places) > 8:
            yield Fault(
                "region", now.tick, now.who_by_ids(ids), f"{places}", "places from 0, 8 at most, as many as count says"
            )


def _touched(now: Moment, ids: tuple[int, int]) -> Iterator[np.ndarray]:
    """Both points of each contact of a pair."""
    contacts = now.told.contacts
    for row in contacts if contacts is not None else ():
        if ids_of(row) == ids:
            yield np.array(row["point_a"])
            yield np.array(row["point_b"])


def _shared(now: Moment, a: int, b: int) -> Iterator[np.ndarray]:
    """A point of each two parts that overlap."""
    forms = now.scene.forms
    one, other = forms.parts_of(int(now.order[a])), forms.parts_of(int(now.order[b]))
    for body, parts in ((now.body(a), other), (now.body(b), one)):
        if body is not None and body.plane is not None:
            for at in range(parts.start, parts.stop):
                point = _deepest(now, at, -np.array(body.plane.normal))
                if np.array(body.plane.normal) @ point < body.plane.offset_m - _NEAR_M:
                    yield point
            return
    for i in range(one.start, one.stop):
        for j in range(other.start, other.stop):
            point = _between(now, i, j)
            if point is not None:
                yield point


def _deepest(now: Moment, at: int, way: np.ndarray) -> np.ndarray:
    """The point of a part that is farthest along a direction."""
    forms = now.scene.forms
    return now.centres[at] + np.sign(way) * forms.half[at] + way * forms.radius[at]


def _between(now: Moment, i: int, j: int) -> Optional[np.ndarray]:
    """A point well within both parts; None where they do not overlap by more than rounding."""
    forms, centres = now.scene.forms, now.centres
    low = np.maximum(centres[i] - forms.half[i], centres[j] - forms.half[j])
    high = np.minimum(centres[i] + forms.half[i], centres[j] + forms.half[j])
    # where the boxes themselves are apart the point lies between them, nearer to the one with the smaller radius
    reach = forms.radius[i] + forms.radius[j]
    share = forms.radius[i] / reach if reach > 0.0 else 0.5
    near_i = np.clip(centres[j], centres[i] - forms.half[i], centres[i] + forms.half[i])
    near_j = np.clip(near_i, centres[j] - forms.half[j], centres[j] + forms.half[j])
    near_i = np.clip(near_j, centres[i] - forms.half[i], centres[i] + forms.half[i])
    point = 0.5 * (low + high) if (low <= high).all() else near_i + (near_j - near_i) * share
    for at in (i, j):
        over = np.maximum(np.abs(point - centres[at]) - forms.half[at], 0.0)
        if np.linalg.norm(over) > forms.radius[at] - _NEAR_M and not (forms.radius[at] == 0.0 and (over == 0.0).all()):
            return None
    return point
