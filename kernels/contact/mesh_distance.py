"""Signed distance to a triangle mesh, and what the points of a sheet remember of its surface.

The nearest triangle is searched with Warp's bounding volume hierarchy in float32; the distance to it is then computed
in float64. Those around it come from a tree of boxes (kernels/contact/distances.py), because Warp's query for them
takes the shared memory of a GPU. Closest point of a triangle: Ericson, Real-Time Collision Detection (2005), section
5.1.5. The sign follows from the angle-weighted normal of the nearest face, edge or vertex (Baerentzen and Aanaes,
Signed distance computation using the angle weighted pseudonormal, IEEE Trans. Vis. Comput. Graph. 11, 2005).

A search takes long, and in contact a point needs several distances in a step, at places much closer to each other than
the triangles are large. So a point remembers, in the frame of the body, where it last searched and
    seen   that place, and the distance of the surface from it;
    faces  the LISTED nearest triangles in order of distance, -1 for none; only where the surface was close;
    apart  distances of the second to fourth of them from that place, and of the nearest triangle that is not listed.
A place that is shifted by s is further away than `reach` from the surface if s + reach is less than the distance seen.
The nearest of the first k triangles is the nearest of all if its distance is less than apart[k - 1] - s. If that is
true for no k, the point searches again. Of several triangles at the same distance the one with the lowest index counts,
so what is remembered changes no result, and restarts begin without it.
"""

import warp as wp

from .distances import BodyShape, MeshSurface, next_face, with_normal

# Number of triangles that a point lists.
LISTED = 4
# Distance from a mesh, divided by its size, below which the normal is that of the nearest triangle.
NEAR = wp.constant(wp.float64(1e-7))


@wp.func
def weights_from_first(ap: wp.vec3d, ab: wp.vec3d, ac: wp.vec3d):
    """Barycentric weights of the point of triangle (a, b, c) nearest to p, from vectors from the first corner."""
    zero = wp.float64(0.0)
    one = wp.float64(1.0)
    bp = ap - ab
    cp = ap - ac
    d1 = wp.dot(ab, ap)
    d2 = wp.dot(ac, ap)
    d3 = wp.dot(ab, bp)
    d4 = wp.dot(ac, bp)
    d5 = wp.dot(ab, cp)
    d6 = wp.dot(ac, cp)
    va = d3 * d6 - d5 * d4
    vb = d5 * d2 - d1 * d6
    vc = d1 * d4 - d3 * d2
    found = wp.vec3d(one, zero, zero)
    if d1 <= zero and d2 <= zero:
        found = wp.vec3d(one, zero, zero)
    elif d3 >= zero and d4 <= d3:
        found = wp.vec3d(zero, one, zero)
    elif vc <= zero and d1 >= zero and d3 <= zero:
        t = d1 / (d1 - d3)
        found = wp.vec3d(one - t, t, zero)
    elif d6 >= zero and d5 <= d6:
        found = wp.vec3d(zero, zero, one)
    elif vb <= zero and d2 >= zero and d6 <= zero:
        t = d2 / (d2 - d6)
        found = wp.vec3d(one - t, zero, t)
    elif va <= zero and d4 - d3 >= zero and d5 - d6 >= zero:
        t = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        found = wp.vec3d(zero, one - t, t)
    else:
        found = wp.vec3d(va, vb, vc) / (va + vb + vc)
    return found


@wp.func
def weights_of_nearest(p: wp.vec3d, a: wp.vec3d, b: wp.vec3d, c: wp.vec3d):
    """Barycentric weights of the point of triangle (a, b, c) nearest to p."""
    return weights_from_first(p - a, b - a, c - a)


@wp.func
def way_from_face(arm: wp.vec3d, f: int, of: MeshSurface):
    """Vector from the nearest point of triangle f [m], and the weights of that point."""
    ap = arm - of.triangles[f, 0]
    ab = of.triangles[f, 1]
    ac = of.triangles[f, 2]
    w = weights_from_first(ap, ab, ac)
    return ap - w[1] * ab - w[2] * ac, w


@wp.func
def square_of(arm: wp.vec3d, f: int, of: MeshSurface):
    """Squared distance of a triangle [m^2]."""
    out, _w = way_from_face(arm, f, of)
    return wp.length_sq(out)


@wp.func
def from_face(f: int, out: wp.vec3d, w: wp.vec3d, of: MeshSurface):
    """Normal and signed distance, where triangle f is the nearest; `out` and `w` as from `way_from_face`."""
    n = of.triangles[f, 3]
    length = wp.length(out)
    distance = wp.dot(out, n)
    if length > NEAR * of.size:
        toward = n
        for k in range(3):
            if w[k] == wp.float64(0.0):
                toward = of.normals[f, k]
        for k in range(3):
            if w[k] == wp.float64(1.0):
                toward = of.normals[f, 3 + k]
        side = wp.where(wp.dot(out, toward) < wp.float64(0.0), wp.float64(-1.0), wp.float64(1.0))
        distance = side * length
        n = (side / length) * out
    return with_normal(n, distance)


@wp.func
def comes_first(square: wp.float64, f: int, other_square: wp.float64, other: int):
    """Whether triangle f is nearer than another one, or as near with a lower index."""
    return square < other_square or (square == other_square and f < other)


@wp.func
def nearest_around(arm: wp.vec3d, within: wp.float64, of: MeshSurface):
    """The LISTED nearest triangles closer than `within` [m], their squared distances and that of the next [m^2]."""
    faces = wp.vec4i(-1, -1, -1, -1)
    next_square = within * within
    squares = wp.vec4d(next_square, next_square, next_square, next_square)
    margin = wp.vec3(wp.float32(within + of.unsure))
    lower = wp.vec3(arm) - margin
    upper = wp.vec3(arm) + margin
    f, node = next_face(0, lower, upper, of.tree)
    while f >= 0:
        square = square_of(arm, f, of)
        if square < next_square:
            here = f
            for k in range(wp.static(LISTED)):
                if comes_first(square, here, squares[k], faces[k]):
                    other = faces[k]
                    other_square = squares[k]
                    faces[k] = here
                    squares[k] = square
                    here = other
                    square = other_square
            if here >= 0:
                next_square = wp.min(next_square, square)
        f, node = next_face(node, lower, upper, of.tree)
    return faces, squares, next_square


@wp.func
def remembered(square: wp.float64, shifted: wp.float64, trust: wp.float64):
    return wp.float32(trust * (wp.sqrt(square) - shifted))


@wp.func(inline=False)
def search(i: int, arm: wp.vec3d, reach: wp.float64, surface: wp.array(dtype=MeshSurface)):
    """Let point i remember the surface around `arm`; with a list where it may be nearer than `reach`."""
    of = surface[0]
    at = wp.vec3(arm)
    shifted = wp.length(arm - wp.vec3d(at))
    furthest = wp.max(of.far, reach)
    free = furthest
    faces = wp.vec4i(-1, -1, -1, -1)
    hit = wp.mesh_query_point_no_sign(of.mesh, at, wp.float32(furthest + of.unsure))
    if hit.result:
        free = wp.min(furthest, wp.sqrt(square_of(arm, hit.face, of)))
    if hit.result and free < wp.max(reach, of.close) + of.unsure:
        faces, squares, next_square = nearest_around(arm, free + of.unsure + of.close, of)
        free = wp.sqrt(squares[0])
        of.apart[i] = wp.vec4(
            remembered(squares[1], shifted, of.trust), remembered(squares[2], shifted, of.trust),
            remembered(squares[3], shifted, of.trust), remembered(next_square, shifted, of.trust),
        )  # fmt: skip
    else:
        free -= of.unsure
    of.faces[i] = faces
    of.seen[i] = wp.vec4(at[0], at[1], at[2], wp.float32(of.trust * (free - shifted)))
    return faces[0]


@wp.func
def gone(seen: wp.vec4, arm: wp.vec3d):
    """Distance of a place from that where a point last searched [m]."""
    return wp.length(arm - wp.vec3d(wp.float64(seen[0]), wp.float64(seen[1]), wp.float64(seen[2])))


@wp.func
def is_clear(seen: wp.vec4, arm: wp.vec3d, reach: wp.float64):
    """Whether a point remembers that the surface is further away than `reach`."""
    return gone(seen, arm) + reach < wp.float64(seen[3])


@wp.func
def look_around(i: int, arm: wp.vec3d, reach: wp.float64, body: BodyShape):
    """Whether the surface may be closer than `reach` to point i, which searches unless it remembers that it is."""
    s = body.seen[i]
    near = not is_clear(s, arm, reach)
    if near:
        seen = wp.float64(s[3])
        if seen <= wp.float64(0.0) or gone(s, arm) + seen > reach:
            search(i, arm, wp.float64(0.0), body.surface)
            near = not is_clear(body.seen[i], arm, reach)
    return near


@wp.func
def mesh_distance(arm: wp.vec3d, reach: wp.float64, body: BodyShape):
    """Signed distance to a triangle mesh, found without memory."""
    of = body.surface[0]
    found = with_normal(wp.vec3d(wp.float64(0.0), wp.float64(0.0), wp.float64(1.0)), reach)
    hit = wp.mesh_query_point_no_sign(of.mesh, wp.vec3(arm), wp.float32(reach + of.unsure))
    if hit.result:
        out, w = way_from_face(arm, hit.face, of)
        found = from_face(hit.face, out, w, of)
    return found


@wp.func(inline=False)
def remembered_distance(i: int, arm: wp.vec3d, reach: wp.float64, surface: wp.array(dtype=MeshSurface)):
    """Signed distance of point i; exactly `reach` if the surface is further away."""
    of = surface[0]
    s = of.seen[i]
    faces = of.faces[i]
    apart = of.apart[i]
    nothing = with_normal(wp.vec3d(wp.float64(0.0), wp.float64(0.0), wp.float64(1.0)), reach)
    found = nothing
    if not is_clear(s, arm, reach):
        shift = gone(s, arm)
        nearest = int(-1)  # noqa: RUF046
        least = wp.float64(wp.inf)
        way = wp.vec3d()
        weights = wp.vec3d()
        sure = bool(False)
        # Variables, so that the loop is not unrolled.
        k = int(0)  # noqa: RUF046
        listed = int(LISTED)
        while k < listed and not sure:
            f = faces[k]
            if f < 0:
                break
            out, w = way_from_face(arm, f, of)
            square = wp.length_sq(out)
            if comes_first(square, f, least, nearest):
                nearest = f
                least = square
                way = out
                weights = w
            known = wp.float64(apart[k]) - shift
            sure = known > wp.float64(0.0) and (reach < known or least < known * known)
            k += 1
        if not sure:
            nearest = search(i, arm, reach, surface)
            if nearest >= 0:
                way, weights = way_from_face(arm, nearest, of)
        if nearest >= 0:
            found = from_face(nearest, way, weights, of)
            if wp.abs(found[3]) >= reach:
                found = nothing
    return found


@wp.func
def mesh_distance_of_point(i: int, arm: wp.vec3d, reach: wp.float64, body: BodyShape):
    """Like `mesh_distance`, of point i, which remembers the surface."""
    return remembered_distance(i, arm, reach, body.surface)
