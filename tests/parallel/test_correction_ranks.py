"""A block's smooth correction on 1, 2 and 3 ranks, solved for or from the cache, or failing."""

import json
from pathlib import Path

import numpy as np

SCRIPT = Path(__file__).with_name("correction_ranks_script.py")


def test_correction_does_not_depend_on_the_ranks(mpirun, monkeypatch, tmp_path, root):
    monkeypatch.setenv("PYTHONPATH", str(root))
    results = {}
    for ranks in (1, 2, 3):
        monkeypatch.setenv("PATCHLAW_CACHE", str(tmp_path / str(ranks)))
        done = mpirun(ranks, SCRIPT)
        assert done.returncode == 0, done.stdout + done.stderr
        found = json.loads(done.stdout.splitlines()[-1])
        assert found["errors"] == ["no room"] * ranks
        results[ranks] = found["values"]
        assert len(list((tmp_path / str(ranks)).iterdir())) == 1
        assert results[ranks]["kept, first"] == results[ranks]["kept, again"]
    for ranks in (2, 3):
        for case, values in results[1].items():
            # direct solutions, in blocks of other sizes
            np.testing.assert_allclose(
                results[ranks][case], values, rtol=1e-10, atol=1e-12, err_msg=case
            )
