"""Cosine and sine without branches, so that a loop over many angles becomes vector instructions."""

from __future__ import annotations

import numpy as np

from gridslam.kernels.compiled import compiled

# pi / 2 as the sum of two numbers: the first has zeros at its end, so that its product with a small integer is exact.
_QUARTER, _QUARTER_REST = 1.5707963267341256, 6.077100506506192e-11


@compiled
def cos_sin(angle_rad: float) -> tuple[float, float]:
    """Cosine and sine of an angle of at most some thousand turns, right to 2e-16.

    The angle is reduced to an eighth of a turn; there both are polynomials (the coefficients are those of fdlibm).
    """
    quarters = np.floor(angle_rad * (2.0 / np.pi) + 0.5)
    r = (angle_rad - quarters * _QUARTER) - quarters * _QUARTER_REST
    z = r * r
    s = 1.58969099521155010221e-10 * z - 2.50507602534068634195e-08
    s = ((s * z + 2.75573137070700676789e-06) * z - 1.98412698298579493134e-04) * z
    s = r + r * z * ((s + 8.33333333332248946124e-03) * z - 1.66666666666666324348e-01)
    c = -1.13596475577881948265e-11 * z + 2.08757232129817482790e-09
    c = ((c * z - 2.75573143513906633035e-07) * z + 2.48015872894767294178e-05) * z
    c = 1.0 - 0.5 * z + z * z * ((c - 1.38888888888741095749e-03) * z + 4.16666666666666019037e-02)
    quarter = quarters - 4.0 * np.floor(0.25 * quarters)
    is_odd = (quarter == 1.0) | (quarter == 3.0)
    cos, sin = (s, c) if is_odd else (c, s)
    return (
        -cos if (quarter == 1.0) | (quarter == 2.0) else cos,
        -sin if quarter >= 2.0 else sin,
    )
