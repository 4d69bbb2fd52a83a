"""Area weights of the bonds: plain, and corrected so that a uniform stress is in equilibrium up to the edge.

The variational bond-associated form has the energy E = h sum_ij W_ij Psi(F_ij). W_ij is the area represented by bond
(i, j), and F_ij = sum_m y_m (x) G_ij,m is the deformation gradient of the intersection D_ij of the families of i and j
(j itself belongs to it):

    G_ij,k = w_ik a_k K_ij^-1 X_ik  for k in D_ij,   G_ij,i = -(sum of these),
    K_ij = sum_{k in D_ij} w_ik a_k X_ik (x) X_ik.

Under a uniform first Piola stress P the internal force on point m is -h P sum_ij W_ij G_ij,m. It balances
the traction on the sheet's edge if sum_ij W_ij G_ij,m = b_m at every point, where b_m is half of each
adjacent edge times its outward normal. The plain weights W0_ij = a_i |D_ij| / sum_j |D_ij| satisfy this only inside a
lattice. The corrected weights satisfy it everywhere, are positive, and differ from W0 as little as possible:

    minimise  sum_q W0_q phi(W_q / W0_q)   subject to   sum_q W_q G_q,m = b_m   for every point m,
    phi(s) = (s - 1)^2 / 2 + (s - 1) / (1 - f) - log((s - f) / (1 - f)),   f = `floor`.

The square measures the relative change; the logarithm keeps W above f W0. Squares alone give weights down to -4.5 W0 at
a horizon of 3.15 spacings, and Newton's method then finds no equilibrium for a sheet that is clamped at both ends and
stretched by 1.2.

On a curved sheet the stress is an equal tension in all directions, G_ij,m are vectors in space (R^-1 K_ij^-1 in place
of K_ij^-1, kernels/kinematics.py), and only the components along the surface are balanced. This does not fix the sum of
the weights, which must equal the area; one more constraint keeps it.

The bond-associated family is that of Yang, Chen & Liu (Eng. Fract. Mech. 2024, 110131). Their published force
uses other weights and has no energy; the energy, the plain weights and the correction were developed in this project.
"""

from .balance import (
    CorrectedWeights,
    corrected_weights,
    edge_vectors,
    edge_vectors_of,
    plain_weights,
    reached_points,
    rim_vectors,
)
from .rectangle import RectangleWeights, rectangle_corrected

__all__ = [
    "CorrectedWeights",
    "RectangleWeights",
    "corrected_weights",
    "edge_vectors",
    "edge_vectors_of",
    "plain_weights",
    "reached_points",
    "rectangle_corrected",
    "rim_vectors",
]
