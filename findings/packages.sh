# Sourced by other scripts with the packages of PyPI to install in a temporary folder, where they go on; PYTHON is the program (python3), ALONE a
# package that is installed without what it asks for.
case " $*" in *" numpy=="*) ;; *) set -- "$@" numpy==2.4.6 ;; esac # which all of them need
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3}" -m venv "$folder/venv"
pip=("$folder/venv/bin/pip" install -qq --no-compile --disable-pip-version-check --only-binary=:all:)
"${pip[@]}" "$@"
[ -z "${ALONE:-}" ] || "${pip[@]}" --no-deps "$ALONE"
cd "$folder"
export PATH=$folder/venv/bin:$PATH OMP_NUM_THREADS=1 PYTHONWARNINGS=ignore
echo ${ALONE:+"$ALONE"} "$@"
