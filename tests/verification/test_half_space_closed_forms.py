"""The half-space model against other closed forms: punch, wavy surface, full contact, energies."""

import numpy as np
import pytest
from helpers.half_space_cases import wave
from scipy.integrate import trapezoid

from patchlaw.geometry import Control, Spectrum, Surface, synthesise
from patchlaw.micro import HalfSpaceModel

SQUARE_PUNCH = 0.36679 * np.pi
"""Force / (E* δ side) of a rigid square punch: π times the capacitance of the unit square plate
over 4π ε0, the same problem (Mukhopadhyay & Majumdar 2007, arXiv 0704.1563, collect values of the
capacitance that agree to these digits)."""


def punch(n):
    """Press a plane of n × n cells by 1 µm; return force / (E* δ side)."""
    surface = Surface(heights=np.zeros((n, n)), lengths=(2.0, 2.0))
    state = HalfSpaceModel(surface=surface, contact_modulus=1.0).press(Control(approach=1e-3))
    assert np.all(state.pressure > 0.0)
    assert state.contact_area == 4.0  # a border is no edge
    return state.force / (1e-3 * 2.0)


def test_square_punch():
    forces = np.array([punch(n) for n in (32, 64, 128)])
    errors = 1.0 - forces / SQUARE_PUNCH
    # The pressure is singular along the edge: first order, 0.34 / n
    assert np.all(errors > 0.0)
    assert errors[:-1] / errors[1:] == pytest.approx([2.0, 2.0], rel=0.05)
    # two extrapolations leave the singular corners
    assert 2.0 * forces[2] - forces[1] == pytest.approx(SQUARE_PUNCH, rel=2e-4)


FULL = np.pi * 0.01  # mean pressure / E* of full contact: π amplitude / wave length


def westergaard(x, share):
    """Return pressure / E* under a mean pressure below full contact (Johnson 1985, eq. 13.8-9)."""
    sine = np.sin(0.5 * np.pi * wet(share))
    inside = np.maximum(sine**2 - np.sin(np.pi * x) ** 2, 0.0)
    return 2.0 * share * FULL * np.cos(np.pi * x) / sine**2 * np.sqrt(inside)


def wet(share):
    """Return the contact fraction, (2/π) asin sqrt(p / p of full contact)."""
    return 2.0 / np.pi * np.arcsin(np.sqrt(share))


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_westergaard(share):
    found = []
    for n in (64, 128, 256):
        surface = wave((n, 5), (1.0, 0.3), 0.01)
        model = HalfSpaceModel(surface=surface, contact_modulus=1.0, periodic=True)
        state = model.press(Control(force=share * FULL * 0.3))
        x = (surface.x + 0.5) % 1.0 - 0.5  # from the crest
        # the same along y, to the residual
        assert np.ptp(state.pressure, axis=1).max() < 1e-5 * FULL
        off = state.pressure[:, 0] - westergaard(x, share)
        found.append(np.sqrt(np.mean(off**2)) / FULL)
        # an edge of the contact lies somewhere in a cell on either side
        assert state.in_contact.mean() == pytest.approx(wet(share), abs=2.0 / n)
    # the square root at the edges: order one or better
    assert found[2] < 8e-4 and found[2] < 0.7 * found[0]


def test_work_of_flattening_a_wave():
    # From first touch to full contact the pressure does the work −∫ p d(mean gap) per area. It is
    # stored in the flattened wave: half of mean pressure · displacement, ¼ FULL · amplitude.
    surface = wave((256, 4), (1.0, 0.1), 0.01)
    model = HalfSpaceModel(surface=surface, contact_modulus=1.0, periodic=True)
    shares = np.linspace(0.0, 1.0, 41)
    gaps = [model.press(Control(force=share * FULL * 0.1)).gap.mean() for share in shares]
    work = -trapezoid(shares * FULL, gaps)
    assert work == pytest.approx(0.25 * FULL * 0.01, rel=2e-3)  # trapezia: 1.4e-3


@pytest.mark.parametrize("share", [1.0, 2.0])
def test_full_contact_of_a_wave(share):
    surface = wave((48, 6), (1.0, 1.0), 0.01)
    model = HalfSpaceModel(surface=surface, contact_modulus=1.0, periodic=True)
    state = model.press(Control(force=share * FULL))
    exact = share * FULL + FULL * np.cos(2.0 * np.pi * surface.x)
    assert state.pressure[:, 0] == pytest.approx(exact, abs=1e-6 * FULL)  # residual 1e-8, n/2 waves
    assert np.abs(state.gap).max() < 1e-8 * state.approach


def test_full_contact_of_a_rough_surface():
    spectrum = Spectrum(hurst=0.8, waves=(1, 12), rms_slope=0.1, seed=2)
    surface = synthesise(spectrum, grid=(54, 50), lengths=(1.0, 0.7))
    model = HalfSpaceModel(surface=surface, contact_modulus=1.0, periodic=True)
    q = [
        2 * np.pi * np.fft.fftfreq(n, d) for n, d in zip(surface.grid, surface.spacing, strict=True)
    ]
    stiffness = 0.5 * np.hypot(q[0][:, None], q[1])
    flattening = np.fft.ifft2(stiffness * np.fft.fft2(surface.heights)).real
    mean = -1.1 * flattening.min()
    state = model.press(Control(force=mean * surface.area))
    assert state.contact_area == pytest.approx(surface.area)
    assert state.contacts == 1
    # residual 1e-8 of the approach times the stiffness of a cell
    assert state.pressure == pytest.approx(mean + flattening, abs=1e-5 * mean)
    assert state.approach == pytest.approx(surface.highest - surface.mean_height, rel=1e-8)
    # just before, by approach: nearly the pressure that just closes the deepest point
    near = model.press(Control(approach=0.9999 * state.approach))
    assert 0.98 < near.contact_area / surface.area < 1.0
    assert near.force == pytest.approx(-flattening.min() * surface.area, rel=0.2)


MODULUS = 1000.0


def test_full_contact_of_a_periodic_surface():
    """Flattened waves u_q store E*/4 Σ q |u_q|² per area (Johnson 1985, 13.2: p = E* q u / 2)."""
    spectrum = Spectrum(hurst=0.8, waves=(1, 6), rms_slope=0.05, seed=3)
    surface = synthesise(spectrum, grid=(32, 40), lengths=(1.0, 1.5))
    model = HalfSpaceModel(surface, contact_modulus=MODULUS, periodic=True, tolerance=1e-12)
    state = model.press(Control(force=0.2 * MODULUS))
    assert state.in_contact.all()
    waves = np.fft.fft2(surface.heights) / surface.heights.size
    along = (
        2 * np.pi * np.fft.fftfreq(n, d) for n, d in zip(surface.grid, surface.spacing, strict=True)
    )
    wave_number = np.hypot(*np.meshgrid(*along, indexing="ij"))
    expected = 0.25 * MODULUS * surface.area * np.sum(wave_number * np.abs(waves) ** 2)
    assert state.elastic_energy == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize(("cells", "bound"), [(48, 3e-3), pytest.param(192, 4e-4)])
def test_hertz(cells, bound):
    """The work of F = 4/3 E* √R δ^(3/2) is 2/5 F δ."""
    x = (np.arange(cells) + 0.5) / cells - 0.5
    radius, approach = 2.0, 2e-2
    sphere = Surface(heights=-(x[:, None] ** 2 + x**2) / (2 * radius), lengths=(1.0, 1.0))
    state = HalfSpaceModel(sphere, contact_modulus=MODULUS, highest=0.0).press(
        Control(approach=approach)
    )
    force = 4 / 3 * MODULUS * np.sqrt(radius * approach**3)
    assert state.elastic_energy == pytest.approx(0.4 * force * approach, rel=bound)
