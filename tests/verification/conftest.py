"""What the tests of verification share: bodies that are solved for once."""

import pytest


@pytest.fixture(scope="module", autouse=True)
def shared_bodies(tmp_path_factory):
    """Let all tests of a process find the compliances of blocks again that one has computed."""
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.getbasetemp() / "bodies"
        patch.setenv("PATCHLAW_CACHE", str(folder))
        yield
