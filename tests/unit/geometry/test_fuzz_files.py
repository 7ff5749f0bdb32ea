"""Files of heights of any content are read, or refused in one line that names them."""

import warnings

from hypothesis import HealthCheck, given, settings

from benchmarks.height_files import anything, read, sides


@settings(
    max_examples=100,
    derandomize=True,
    database=None,
    deadline=None,
    suppress_health_check=list(HealthCheck),
)
@given(anything, sides)
def test_files_of_any_content(tmp_path_factory, file, lengths):
    suffix, content = file
    path = tmp_path_factory.getbasetemp() / f"heights{suffix}"
    path.write_bytes(content)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert read(path, lengths) in ("read", "refused")
