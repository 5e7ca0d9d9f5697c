"""One geom as sweepd's shape, and as a support function for the third judge.

In: a compiled model and a geom id. Out: a dict with the keys of a scene file's shape, or points of a convex set.
Sizes are half sizes in MuJoCo, as in sweepd. Axes of capsules and cylinders are local z in both.
"""

import mujoco
import numpy as np

from .model import GEOM, Refused, geom_title


CORNERS_MAX = 4096
"""Most corners of a hull in sweepd; a larger one is told as the closed mesh of its faces."""


def hull_vertices(model, geom):
    """`[n, 3]` vertices that MuJoCo collides a mesh with, metres, geom frame: its hull's, or all where it has no hull."""
    mesh = int(model.geom_dataid[geom])
    first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    vertices = model.mesh_vert[first : first + count].astype(float)
    graph = hull_graph(model, mesh)
    if graph is not None:
        vertices = vertices[graph[0]]
    return np.unique(vertices, axis=0)


def hull_graph(model, mesh):
    """Vertices `[n]` and faces `[m, 3]` of MuJoCo's hull, as places in the mesh; None where it made no hull."""
    start = int(model.mesh_graphadr[mesh])
    if start < 0:
        return None
    # Layout: numvert, numface, vert_edgeadr[numvert], vert_globalid[numvert], edge_localid[numvert + 3 numface],
    # face_globalid[3 numface].
    graph = model.mesh_graph[start:]
    numvert, numface = int(graph[0]), int(graph[1])
    faces = 2 + 3 * numvert + 3 * numface
    return graph[2 + numvert : 2 + 2 * numvert], graph[faces : faces + 3 * numface].reshape(-1, 3)


def hull_faces(model, geom, vertices):
    """`[m, 3]` faces of the hull as places in `vertices`, the rows of `hull_vertices`."""
    mesh = int(model.geom_dataid[geom])
    first = int(model.mesh_vertadr[mesh])
    corners, faces = hull_graph(model, mesh)
    place = {tuple(vertex): k for k, vertex in enumerate(vertices.tolist())}
    new = {int(c): place[tuple(model.mesh_vert[first + int(c)].astype(float).tolist())] for c in corners}
    return [[new[int(c)] for c in face] for face in faces]


def hfield_grid(model, geom):
    """Heights `[rows, columns]` in metres, full size in x and y, and the floor's depth below 0, metres."""
    field = int(model.geom_dataid[geom])
    rows, columns = int(model.hfield_nrow[field]), int(model.hfield_ncol[field])
    first = int(model.hfield_adr[field])
    half_x, half_y, top, base = (float(v) for v in model.hfield_size[field])
    samples = model.hfield_data[first : first + rows * columns].astype(float)
    return samples.reshape(rows, columns) * top, (2 * half_x, 2 * half_y), base


def shape_of(model, geom):
    """The shape of a geom in the words of a scene file."""
    kind = GEOM(int(model.geom_type[geom]))
    size = [float(v) for v in model.geom_size[geom]]
    if kind == GEOM.mjGEOM_PLANE:
        # Infinite and one-sided for MuJoCo's collisions, whatever size it is drawn with.
        return {"type": "half_space", "normal": [0.0, 0.0, 1.0], "offset": 0.0}
    if kind == GEOM.mjGEOM_SPHERE:
        return {"type": "sphere", "radius": size[0]}
    if kind in (GEOM.mjGEOM_CAPSULE, GEOM.mjGEOM_CYLINDER):
        word = "capsule" if kind == GEOM.mjGEOM_CAPSULE else "cylinder"
        return {"type": word, "radius": size[0], "half_height": size[1]}
    if kind == GEOM.mjGEOM_BOX:
        return {"type": "box", "half_extents": size}
    if kind == GEOM.mjGEOM_MESH:
        vertices = hull_vertices(model, geom)
        spread = np.linalg.svd(vertices - vertices.mean(axis=0), compute_uv=False)
        if len(vertices) < 4 or spread[2] <= 1e-9 * spread[0]:
            raise Refused(f"{geom_title(model, geom)}: its mesh is flat: give it a thickness")
        if len(vertices) > CORNERS_MAX and hull_graph(model, int(model.geom_dataid[geom])) is not None:
            faces = hull_faces(model, geom, vertices)
            return {"type": "trimesh", "vertices": vertices.tolist(), "faces": faces, "solid": True}
        return {"type": "convex", "vertices": vertices.tolist()}
    if kind == GEOM.mjGEOM_HFIELD:
        heights, full, base = hfield_grid(model, geom)
        # MuJoCo's floor lies `base` below 0, sweepd's `base_m` below the least sample.
        floor = base + float(heights.min())
        return {"type": "height_field", "heights": heights.tolist(), "size": list(full), "base_m": floor}
    raise Refused(f"{geom_title(model, geom)}: sweepd has no shape of kind {kind.name}")


def support(shape, directions):
    """Largest `direction . x` over a convex shape, shape frame.

    * `directions` - `[n, 3]`, any length.
    * returns - `[n]`; infinity where a half-space has no end.
    """
    kind = shape["type"]
    length = np.linalg.norm(directions, axis=1)
    flat = np.linalg.norm(directions[:, :2], axis=1)
    if kind == "sphere":
        return shape["radius"] * length
    if kind == "box":
        return np.abs(directions) @ np.array(shape["half_extents"])
    if kind == "capsule":
        return shape["radius"] * length + shape["half_height"] * np.abs(directions[:, 2])
    if kind == "cylinder":
        return shape["radius"] * flat + shape["half_height"] * np.abs(directions[:, 2])
    if kind in ("convex", "trimesh"):
        # A mesh is only written for a hull, so its corners are its ends too.
        return (directions @ np.asarray(shape["vertices"]).T).max(axis=1)
    if kind == "half_space":
        along = directions @ np.asarray(shape["normal"])
        is_normal = np.isclose(along, length, rtol=1e-12, atol=0)
        return np.where(is_normal, shape["offset"] * along, np.inf)
    raise ValueError(f"{kind} is not convex")


def prisms(shape, low, high):
    """The solid of a height field as convex pieces: those that can reach a box.

    * `low`, `high` - corners of the box, field frame, metres.
    * returns - list of convex shapes, one a triangle of the surface, down to the floor. Cells are cut from their
      lower-left to their upper-right sample, as MuJoCo does.
    """
    heights = np.asarray(shape["heights"])
    rows, columns = heights.shape
    x = np.linspace(-shape["size"][0] / 2, shape["size"][0] / 2, columns)
    y = np.linspace(-shape["size"][1] / 2, shape["size"][1] / 2, rows)
    floor = heights.min() - shape["base_m"]
    first_c, last_c = reach(x, low[0], high[0])
    first_r, last_r = reach(y, low[1], high[1])
    pieces = []
    for r in range(first_r, last_r):
        for c in range(first_c, last_c):
            for corner in ((r, c + 1), (r + 1, c)):
                top = [(x[j], y[i], heights[i, j]) for i, j in ((r, c), corner, (r + 1, c + 1))]
                bottom = [(px, py, floor) for px, py, _ in top]
                pieces.append({"type": "convex", "vertices": top + bottom})
    return pieces


def reach(places, low, high):
    """First and last cell (exclusive) between sorted places that [low, high] can reach; at least one cell."""
    first = int(np.searchsorted(places, low, side="left")) - 1
    last = int(np.searchsorted(places, high, side="right"))
    first = min(max(first, 0), len(places) - 2)
    return first, min(max(last, first + 1), len(places) - 1)


def place(shape_points, rotation, position):
    """World coordinates of points."""
    return np.asarray(shape_points) @ rotation.T + position


def mat_to_quat(matrix):
    """Rotation matrix (9 numbers, by rows) to a quaternion w, x, y, z."""
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, np.ascontiguousarray(matrix, dtype=float).ravel())
    return quat / np.linalg.norm(quat)
