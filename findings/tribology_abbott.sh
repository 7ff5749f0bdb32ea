#!/usr/bin/env bash
# tribology: abbottfirestone, the Abbott-Firestone curve of a profile.
#
# Guess: the share of the profile above each height, from 0 to 1 or to 100 %, however many heights it is asked at.
# Seen: it ends at the number of heights: at 100, the default, these are per cent, at 50 the lowest height has 50, at 200 it has 200, so
# that material ratios and what is read at 10 or 80 % are off by that factor. Divide by num_bins.
set -euo pipefail
source "$(dirname "$0")/packages.sh" opencv-python-headless==5.0.0.93 scipy==1.17.1 matplotlib==3.11.2 numexpr==2.14.2 setuptools==80.9.0
pip install -qq --disable-pip-version-check --no-deps --only-binary=:all: tribology==0.5.16 # which asks for another numpy
python - <<'END'
import numpy as np
from tribology import abbottfirestone

ramp = np.linspace(0, 1, 1001)  # half of it lies above 0.5
for number in (100, 50, 200):
    heights, shares = abbottfirestone(ramp, number)
    middle = np.interp(0.5, heights[::-1], shares[::-1])
    print(f"{number} heights: {middle:.1f} above the middle, {shares[-1]:.1f} in all")
    assert abs(middle - number / 2) < 1 and shares[-1] == number
END
