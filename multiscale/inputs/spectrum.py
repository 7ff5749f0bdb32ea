"""How finely the grid of a surface resolves the waves of its spectrum."""

from __future__ import annotations

from multiscale.scene.sections import SpectrumSection


def heights_per_wave(
    spectrum: SpectrumSection, grid: tuple[int, int], lengths: tuple[float, float]
) -> float:
    """Return the heights along the shortest wavelength of a spectrum.

    Args:
        spectrum: The spectrum.
        grid: Heights in x and y.
        lengths: Sides of the surface [mm].
    """
    return min(n / most for n, most in zip(grid, most_waves(spectrum, lengths), strict=True))


def most_waves(spectrum: SpectrumSection, lengths: tuple[float, float]) -> list[float]:
    """Return the largest number of waves along each side.

    Args:
        spectrum: The spectrum.
        lengths: Sides of the surface [mm].
    """
    if spectrum.waves is not None:  # counted along x
        return [spectrum.waves[1], spectrum.waves[1] * lengths[1] / lengths[0]]
    return [band[1] for band in (spectrum.waves_x, spectrum.waves_y) if band]
