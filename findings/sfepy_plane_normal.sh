#!/usr/bin/env bash
# SfePy 2021.4 of Debian 12: the plane of the contact term dw_contact_plane.
#
# Guess: its normal may have any direction.
# Seen: (0, 0, -1) is refused by "assertion failed!", the one direction for which no axis of rotation to the z axis
# can be had. A plane below a body, with the body's outward normal, is that case; with 0.001 along y it works.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
apt-get download -q python3-sfepy=2021.4-4+b1 >apt.log 2>&1 || { cat apt.log; exit 2; }
dpkg-deb -x python3-sfepy*.deb tree
PYTHONPATH=$folder/tree/usr/lib/python3/dist-packages /usr/bin/python3 - <<'END' 2>warnings.log
import numpy as np
import sfepy
from sfepy.mechanics.contact_bodies import ContactPlane

print("sfepy", sfepy.__version__)
corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]
inside = np.array([[0.5, 0.25, 0.1]])
for normal in ([0.0, 0.0, 1.0], [0.0, 1e-3, -1.0], [0.0, 0.0, -1.0]):
    try:
        plane = ContactPlane([0.0, 0.0, 0.0], normal, corners)
        print(normal, "penetration of a point 0.1 above", plane.get_distance(inside), plane.mask_points(inside))
        assert normal[2] == 1.0 or normal[1] > 0
    except ValueError as error:
        print(normal, "ValueError:", error)
        assert normal == [0.0, 0.0, -1.0]
END
