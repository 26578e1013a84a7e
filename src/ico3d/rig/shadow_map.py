"""The map in which a distant lamp sees a body on a rig, as training, bundles and pages draw it.

Spheres just under the skin are drawn into it; a place on the skin looks at the texels about it.
"""

RADIUS = 0.02
"""Metres of the spheres that cast shadows, which lie just under the skin, this far apart."""
TEXEL = 0.0125
"""Metres of the map's texels."""
SIDE = 256
"""Texels along the map's sides, a power of two. It repeats every 3.2 m, across which nobody
reaches: so it needs no frame that follows the person."""
OFF = 0.01
"""Metres above the skin at which light is looked for."""
BIAS = 0.03
"""Metres behind the nearest sphere that are lit all the same, or skin would shade itself."""
EDGE = 0.002
"""Metres over which depth goes from shadow to light, so that rounding is not seen."""
FAR = -1e9
"""Metres towards the lamp where no sphere lies."""
WRAP = 0.2
"""Cosine by which a lamp reaches past the edge of its light: skin and cloth are soft."""
