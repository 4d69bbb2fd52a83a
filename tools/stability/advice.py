"""What a user can do about the limits of each group of cases."""

from .cases.material import LOCK_RATIO
from .verdicts import short

# By how the names of the cases begin.
ADVICE = {
    "K/mu = ": "Nothing to do: the volume change is computed from the strain, not from a number near one.",
    "99 % of the lock, Jm = ": f"K/mu is {short(LOCK_RATIO)} here, because softer sheets swell instead. Near the lock "
    "a sheet stiffens within a few steps: lower `safety`. The forces of nodal and closed form do not balance "
    "beside an edge under uniform stress. There they reach the lock and the run ends with a message: take `corrected`.",
    "relaxation": "Any relaxation time: the update is exact for any step. The printed series (VE eq. 60) grows without "
    "bound where a term relaxes within a step, as in fast motion: take `exact`.",
    "thickness": "Any thickness: neither the strain nor the step depends on it.",
    "units": "Any units: lengths are stored over the horizon, areas over that of a point.",
    "step": "The estimate is a bound. Undamped laws without a potential grow slowly at any step: add damping, or take "
    "`plain` or `corrected`.",
    "cloud": "A sheet that is not in equilibrium recoils and stiffens: lower `safety`. The horizon must reach the "
    "neighbours where the spacing is widest. So families of graded clouds are large where it is finest, and corrected "
    "weights take long there.",
    "sheet turned": "The law `HyperelasticBonds` has a fixed direction: take it for sheets that stretch without "
    "turning.",
    "a bond turned": "Folds stiffen within a few steps: lower `safety`. Hyperelastic bonds lose their force when they "
    "turn.",
    "compression": "A compressed sheet crumples down to its spacing, because it has no bending stiffness: lower "
    "`safety`, add damping, or take `Relaxation` if only the equilibrium matters. Hyperelastic bonds are made for "
    "tension.",
    "a chain": "Strands a few bonds wide gain energy under laws without a potential: add damping.",
    "zero-energy": "The nodal law does not feel motion finer than a family. It is a baseline, not for results.",
    "ball": "Any speed: in one step a ball moves at most a quarter of a spacing, so fast balls cost steps.",
    "restart": "Bit for bit.",
    "two runs": "Bit for bit: forces are gathered, nothing is added atomically.",
    "rigid spin": "Rotation alone costs no energy. Free and undamped, the published weights grow from round-off, and "
    "hyperelastic bonds create energy as they turn.",
    "undamped": "Laws without a potential gain or lose energy in the long run: take `plain` or `corrected`. Viscous "
    "sheets only lose energy.",
}
