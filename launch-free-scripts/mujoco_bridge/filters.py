"""Who may collide: MuJoCo's rules as sweepd's groups, rigid groups and pair rules.

MuJoCo collides two geoms if
- they are an explicit `<pair>`, or else
- `contype` of one meets `conaffinity` of the other (one way is enough), and
- their bodies are not welded to each other, at least one of them has a degree of freedom, and
- neither is welded to the parent of the other (unless the world is that parent, or the flag filterparent is off), and
- their bodies are not an `<exclude>`.

sweepd wants both ways: `group_a & mask_b` and `group_b & mask_a`. So every class of (contype, conaffinity) gets a bit
of its own, which is exact for up to 32 classes; beyond that the rest become pair rules. Welded geoms become a rigid
group; parents, excludes and explicit pairs become rules. `allowed_by_scene` reads the result back with sweepd's law,
and the bridge starts only if both matrices are equal.
"""

import fnmatch
import re
from functools import lru_cache

import mujoco
import numpy as np

from .model import GEOM

GROUPS_MAX = 32
"""Bits of a group."""
NAME_BYTES_MAX = 104
"""Longest name of a body in sweepd, bytes."""
SURFACES = (int(GEOM.mjGEOM_PLANE), int(GEOM.mjGEOM_HFIELD))
"""Kinds that MuJoCo never collides with each other."""


@lru_cache
def collides_without_dofs():
    """Whether this MuJoCo collides a mocap body with the world: versions differ, so it is asked."""
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><geom size="1"/><body mocap="true"><geom size="1"/></body></worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_collision(model, data)
    return data.ncon > 0


def is_still(model, body):
    """Whether a body can never move: no joint above it, and no mocap body."""
    while body:
        if model.body_jntnum[body] or model.body_mocapid[body] >= 0:
            return False
        body = int(model.body_parentid[body])
    return True


def allowed_by_mujoco(model, geoms):
    """`[n, n]` of bool: whether MuJoCo asks if two geoms collide."""
    contype = model.geom_contype[geoms].astype(np.int64)
    conaffinity = model.geom_conaffinity[geoms].astype(np.int64)
    meets = (contype[:, None] & conaffinity[None]) != 0
    allowed = meets | meets.T

    bodies = model.geom_bodyid[geoms]
    weld = model.body_weldid[bodies]
    allowed &= weld[:, None] != weld[None]
    if not collides_without_dofs():
        free = model.body_treeid[bodies] >= 0
        allowed &= free[:, None] | free[None]
    if not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_FILTERPARENT:
        above = model.body_weldid[model.body_parentid[weld]]
        is_child = (above[:, None] == weld[None]) & (weld[:, None] != 0) & (weld[None] != 0)
        allowed &= ~(is_child | is_child.T)
    for first, second in excludes(model):
        both = (bodies[:, None] == first) & (bodies[None] == second)
        allowed &= ~(both | both.T)
    place = {int(geom): k for k, geom in enumerate(geoms)}
    for first, second in explicit_pairs(model):
        allowed[place[first], place[second]] = allowed[place[second], place[first]] = True

    # Planes and height fields have no collision with each other at all.
    surface = np.isin(model.geom_type[geoms], SURFACES)
    allowed &= ~(surface[:, None] & surface[None])
    np.fill_diagonal(allowed, False)
    return allowed


def excludes(model):
    """Body ids of each `<exclude>`."""
    return [(int(s) >> 16, int(s) & 0xFFFF) for s in model.exclude_signature]


def explicit_pairs(model):
    """Geom ids of each `<pair>`."""
    return [(int(a), int(b)) for a, b in zip(model.pair_geom1, model.pair_geom2)]


def names_of(model, geoms):
    """A name for each geom: the first body it is welded to, a colon, its own name. Unique, no pattern in it."""
    names, taken = [], set()
    for geom in geoms:
        root = root_name(model, int(model.body_weldid[model.geom_bodyid[geom]]))
        own = plain(model.geom(int(geom)).name) or f"geom{geom}"
        name = f"{root}:{own}"
        if name in taken or len(name.encode()) > NAME_BYTES_MAX:
            name = f"{root}:geom{geom}"
        taken.add(name)
        names.append(name)
    return names


def root_name(model, weld):
    """Name of a weld root, short enough to leave room for its geoms; told apart by number where two would be equal."""
    name = plain(model.body(weld).name)
    numbered = f"body{weld}"
    if not name or len(name.encode()) > NAME_BYTES_MAX // 2:
        return numbered
    same = [b for b in range(model.nbody) if b != weld and plain(model.body(b).name) == name]
    looks_numbered = re.fullmatch(r"body\d+", name)
    return numbered if same or looks_numbered else name


def plain(name):
    """A name without what sweepd's patterns and these names give a meaning to."""
    return re.sub(r'[*?:"\\\x00-\x1f]', "_", name)


def filters_of(model, geoms, names):
    """Groups, masks, rigid groups and rules for a scene.

    * returns - dict of `group` and `mask` (`[n]` of int), `rigid_group` (`[n]` of str or None), `still` (`[n]` of
      bool: sweepd never pairs two of those) and `rules`: dicts with action, a, b, reason; the last that matches wins.
    """
    group, mask = bits_of(model, geoms)
    bodies = model.geom_bodyid[geoms]
    still = [is_still(model, int(body)) for body in bodies]
    weld = model.body_weldid[bodies]
    roots = [name.split(":")[0] for name in names]
    crowd = {root: roots.count(root) for root in set(roots)}
    rigid = [root if crowd[root] > 1 else None for root in roots]
    rules = []

    # Two bodies without a degree of freedom: welded to the world, or mocap.
    if not collides_without_dofs():
        stuck = sorted({int(w) for b, w in zip(bodies, weld) if model.body_treeid[b] < 0})
        for k, first in enumerate(stuck):
            for second in stuck[k + 1 :]:
                rules.append(rule("ignore", by_root(model, first), by_root(model, second), "neither can be pushed"))
    if not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_FILTERPARENT:
        for child in sorted(set(weld.tolist())):
            parent = int(model.body_weldid[model.body_parentid[child]])
            if child and parent and parent in weld:
                rules.append(rule("ignore", by_root(model, parent), by_root(model, child), "parent and child"))
    for first, second in excludes(model):
        for a in of_body(model, first, geoms, names):
            for b in of_body(model, second, geoms, names):
                rules.append(rule("ignore", a, b, "excluded by the model"))
    surfaces = [k for k, geom in enumerate(geoms) if model.geom_type[geom] in SURFACES]
    for k in surfaces:
        for m in surfaces:
            if k < m and not (still[k] and still[m]):
                rules.append(rule("ignore", names[k], names[m], "MuJoCo has no such collision"))
    name_of = {int(geom): name for geom, name in zip(geoms, names)}
    for first, second in explicit_pairs(model):
        if not (model.geom_type[first] in SURFACES and model.geom_type[second] in SURFACES):
            rules.append(rule("check", name_of[first], name_of[second], "a pair of the model"))
    found = {"group": group, "mask": mask, "rigid_group": rigid, "still": still, "rules": rules}
    mend(model, geoms, names, found)
    return found


def rule(action, a, b, reason):
    """One `[[rule]]`."""
    return {"action": action, "a": a, "b": b, "reason": reason}


def by_root(model, weld):
    """Pattern of all geoms of a weld root."""
    return root_name(model, weld) + ":*"


def of_body(model, body, geoms, names):
    """Names of a body's geoms, as one pattern where the body is all of its rigid group."""
    own = [name for geom, name in zip(geoms, names) if model.geom_bodyid[geom] == body]
    pattern = by_root(model, int(model.body_weldid[body]))
    crowd = [name for name in names if fnmatch.fnmatchcase(name, fnmatch_pattern(pattern))]
    return [pattern] if own and len(own) == len(crowd) else own


def bits_of(model, geoms):
    """Group and mask of each geom: one bit a class of (contype, conaffinity)."""
    classes = sorted({(int(model.geom_contype[g]), int(model.geom_conaffinity[g])) for g in geoms})
    bit = {key: 1 << min(k, GROUPS_MAX - 1) for k, key in enumerate(classes)}
    mask = {}
    for contype, conaffinity in classes:
        met = [k for k in classes if contype & k[1] or k[0] & conaffinity]
        mask[contype, conaffinity] = int(np.bitwise_or.reduce([0] + [bit[k] for k in met]))
    keys = [(int(model.geom_contype[g]), int(model.geom_conaffinity[g])) for g in geoms]
    return [bit[k] for k in keys], [mask[k] for k in keys]


def mend(model, geoms, names, found):
    """Where more than 32 classes share a bit, the pairs that then differ become rules of their own."""
    wanted = allowed_by_mujoco(model, geoms)
    differs = np.triu(wanted != allowed_by_scene(found, names))
    still = np.array(found["still"])
    for k, m in zip(*np.nonzero(differs & ~(still[:, None] & still[None]))):
        action = "check" if wanted[k, m] else "ignore"
        found["rules"].append(rule(action, names[k], names[m], "contype and conaffinity"))


def fnmatch_pattern(pattern):
    """A sweepd pattern for `fnmatch`: brackets mean nothing to sweepd."""
    return pattern.replace("[", "[[]")


def allowed_by_scene(found, names):
    """`[n, n]` of bool: whether sweepd checks a pair, by its law (rules, then rigid groups, then masks)."""
    group = np.array(found["group"], dtype=np.uint64)
    mask = np.array(found["mask"], dtype=np.uint64)
    meets = (group[:, None] & mask[None]) != 0
    allowed = meets & meets.T
    rigid = np.array([g or "" for g in found["rigid_group"]], dtype=object)
    allowed &= ~((rigid[:, None] == rigid[None]) & (rigid[:, None] != ""))
    known = np.array(names, dtype=object)
    for entry in found["rules"]:
        sides = []
        for key in ("a", "b"):
            if "*" in entry[key]:
                regex = re.compile(fnmatch.translate(fnmatch_pattern(entry[key])))
                sides.append(np.array([bool(regex.match(name)) for name in names]))
            else:
                sides.append(known == entry[key])
        both = sides[0][:, None] & sides[1][None]
        allowed[both | both.T] = entry["action"] == "check"
    still = np.array(found["still"], dtype=bool)
    allowed &= ~(still[:, None] & still[None])
    np.fill_diagonal(allowed, False)
    return allowed
