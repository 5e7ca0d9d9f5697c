"""Loads an MJCF model: what sweepd has no shape for is refused by name, or turned into a hull when asked.

In: a path. Out: a compiled `mujoco.MjModel`. A hull replaces its geom in MuJoCo too, so that both sides collide the
same shape.
"""

from pathlib import Path

import mujoco
import numpy as np

GEOM = mujoco.mjtGeom


class Refused(Exception):
    """What cannot be done, and what to change."""


def collidable(model):
    """Ids of the geoms that MuJoCo can ever collide: by their bits, or by an explicit pair."""
    by_bits = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    by_pair = np.zeros(model.ngeom, dtype=bool)
    by_pair[model.pair_geom1] = True
    by_pair[model.pair_geom2] = True
    return np.flatnonzero(by_bits | by_pair)


def geom_title(model, geom):
    """A geom by name, or by its number and its body."""
    name = model.geom(geom).name
    if name:
        return f'geom "{name}"'
    body = model.body(int(model.geom_bodyid[geom])).name
    return f'geom {geom} of body "{body}"'


def load(path, hull_ellipsoids=False, hull_sdf=False, without_flex=False):
    """Compiles a model.

    Raises Refused for what MuJoCo cannot compile and for kinds that sweepd lacks.
    """
    if not Path(path).is_file():
        raise Refused(f"{path}: there is no such file")
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        model = spec.compile()
    except (ValueError, OSError) as error:
        raise Refused(f"{path}: MuJoCo does not compile it: {error}") from None
    wanted = {GEOM.mjGEOM_ELLIPSOID: hull_ellipsoids, GEOM.mjGEOM_SDF: hull_sdf}
    lacking = [g for g in collidable(model) if GEOM(int(model.geom_type[g])) in wanted]
    refused = [g for g in lacking if not wanted[GEOM(int(model.geom_type[g]))]]
    if refused:
        raise Refused(refusal(path, model, refused))
    if model.nflex and not without_flex:
        names = ", ".join(f'"{flex.name}"' for flex in spec.flexes)
        raise Refused(
            f"{path}: flex {names}: sweepd has no deformable bodies here: remove them,"
            " or leave them out of the comparison with --without-flex"
        )
    if lacking:
        replace_by_hulls(spec, model, lacking)
        try:
            model = spec.compile()
        except ValueError as error:
            raise Refused(f"{path}: MuJoCo does not compile the hulls: {error}") from None
    return model


def refusal(path, model, refused):
    """One line for each geom of a kind that sweepd lacks, at most ten."""
    words = {int(GEOM.mjGEOM_ELLIPSOID): "an ellipsoid", int(GEOM.mjGEOM_SDF): "an SDF"}
    lines = [f"{path}: sweepd has no such shapes:"]
    for geom in refused[:10]:
        lines.append(f"  {geom_title(model, geom)} is {words[int(model.geom_type[geom])]}")
    if len(refused) > 10:
        lines.append(f"  and {len(refused) - 10} more")
    lines.append("turn them into hulls with --hull-ellipsoids and --hull-sdf (in MuJoCo too)")
    return "\n".join(lines)


def replace_by_hulls(spec, model, geoms):
    """Turns geoms of a spec into meshes, which MuJoCo collides as their hulls."""
    by_id = {geom.id: geom for geom in spec.geoms}
    for number in geoms:
        geom = by_id[int(number)]
        if int(model.geom_type[number]) == GEOM.mjGEOM_ELLIPSOID:
            points = sphere_points() * model.geom_size[number]
            name = f"sweepd_hull_{number}"
            spec.add_mesh(name=name, uservert=points.ravel())
            # Compiled place and size: a fitted or from-to ellipsoid has none of its own.
            geom.fromto = np.full(6, np.nan)
            geom.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
            geom.pos = model.geom_pos[number]
            geom.quat = model.geom_quat[number]
            geom.meshname = name
        geom.plugin.active = False
        geom.type = GEOM.mjGEOM_MESH


def sphere_points():
    """`[162, 3]` points of a unit sphere: an icosahedron whose faces were cut twice."""
    golden = (1 + 5**0.5) / 2
    corners = [(0, a, b * golden) for a in (-1, 1) for b in (-1, 1)]
    points = np.array([np.roll(c, k) for c in corners for k in range(3)], dtype=float)
    for _ in range(2):
        # The nearest neighbours share an edge; a cut edge gives its middle.
        apart = np.linalg.norm(points[:, None] - points[None], axis=2)
        shortest = np.where(apart > 0, apart, np.inf).min()
        first, second = np.nonzero(np.triu((apart > 0) & (apart < 1.3 * shortest)))
        points = np.vstack([points, (points[first] + points[second]) / 2])
        points /= np.linalg.norm(points, axis=1, keepdims=True)
    return points
