# Sourced by calculix_*.sh with the packages of Debian 12 to unpack in a temporary folder; CCX is the program. Its other libraries
# (LAPACK, Open MPI, gfortran) are those that setup.sh installs with dolfinx.
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
apt-get download -q "$@" >apt.log 2>&1 || { cat apt.log; exit 2; }
for package in *.deb; do dpkg-deb -x "$package" tree; done
export CCX=$folder/tree/usr/bin/ccx OMP_NUM_THREADS=1 PYTHONPATH=$here
LD_LIBRARY_PATH=$(dirname "$(find "$folder/tree" -name 'libspooles.so*' | head -n 1)")
export LD_LIBRARY_PATH
