#!/usr/bin/env bash
# TopoStats: rms_roughness of its image_statistics, of heights as they are and as its Filters flatten them.
#
# Guess: it is Sq, the standard deviation of heights about their mean, so that bumps and pits of one shape have the same.
# Seen: it is taken about the height 0. A plane at 100 nm has 100 nm. Filters set the background's median to 0, not the mean: bumps of
# Sq 0.669 nm have 0.724 nm, the same as pits 0.669 nm. Take the mean away before.
set -euo pipefail
source "$(dirname "$0")/packages.sh" scikit-image==0.26.0 pandas==3.1.1 pydantic==2.14.4 snoop==0.6.1 matplotlib==3.11.2 pyyaml==6.0.4
pip install -qq --disable-pip-version-check --no-deps --only-binary=:all: topostats==2.4.2 # which asks for another numpy, and tensorflow
python - <<'END'
import logging
from importlib import resources

import numpy as np
import topostats
import yaml
from topostats.classes import TopoStats
from topostats.filters import Filters
from topostats.statistics import image_statistics

logging.disable(logging.CRITICAL)
settings = (resources.files(topostats) / "default_config.yaml").read_text()


def flattened(heights):
    filters = yaml.safe_load(settings)["filter"]
    filters.pop("run")
    image = TopoStats(image_original=heights.copy(), filename="map", pixel_to_nm_scaling=2.0, img_path="./")
    Filters(topostats_object=image, **filters).filter_image()
    return image.image


waves = np.cos(np.pi * np.arange(128) / 16)
bumps = 4 * np.maximum(np.outer(waves, waves) - 0.3, 0)
maps = {"plane at 100": np.full((128, 128), 100.0), "bumps": bumps, "bumps, flattened": flattened(bumps), "pits, flattened": flattened(-bumps)}
for (name, heights), seen in zip(maps.items(), (100.0, 0.80323, 0.72380, 0.66851), strict=True):
    rms = image_statistics(heights, "map", 2.0, 0)["rms_roughness"] * 1e9
    level = image_statistics(heights - heights.mean(), "map", 2.0, 0)["rms_roughness"] * 1e9
    print(f"{name}: rms_roughness {rms:.5f} nm, about the mean {level:.5f}, standard deviation {heights.std():.5f}, mean {heights.mean():.5f}")
    assert abs(rms - seen) < 2e-5 and abs(rms - np.hypot(heights.std(), heights.mean())) < 1e-9
    assert abs(level - heights.std()) < 1e-9
END
