"""The smallest scene with a rough contact: a half-space of 16 × 16 cells, two load steps."""

SMALL_SCENE = """
[surface]
spectrum = { hurst = 0.95, waves = [2, 5], rms_slope = 0.215, seed = 1 }
grid = [16, 16]
lengths = ["1 mm", "1 mm"]
[block]
young_modulus = "4 GPa"
poisson_ratio = 0.15
[patches]
grid = [2, 4]
[micro]
model = "half-space"
[coupling]
kind = "analytic"
[load]
approach = "8 um"
steps = 2
[output]
figures = false
report = false
check = "none"
"""
