"""Runs random scenes and checks what must hold of every one; see ``--help``."""

import argparse
import os
import sys
import tempfile
import time
import traceback
import warnings
from collections import defaultdict
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from helpers.random_scenes import drawn
from helpers.scene_invariants import checks

from patchlaw import InputError, NotConverged


def tried(seed, folder):
    """Check one scene; return its case, what was found, and how it ended."""
    case, found = drawn(seed), []
    try:
        for one in checks(case, folder):
            found.append(one)
    except InputError as error:
        return case, found, f"refused: {error}"
    except NotConverged as error:
        return case, found, f"not converged: {error}"
    except Exception:
        return case, found, f"DEFECT: {traceback.format_exc()[-1500:]}"
    return case, found, ""


def main():
    """Run the campaign; print every failure, then a line for every invariant."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0, help="the first scene")
    choice = parser.parse_args()
    warnings.simplefilter("error", RuntimeWarning)
    errors, failed, ends = defaultdict(list), defaultdict(list), defaultdict(list)
    with tempfile.TemporaryDirectory(prefix="$ odd \x07 name") as folder:
        os.environ["PATCHLAW_CACHE"] = folder
        for seed in range(choice.seed, choice.seed + choice.scenes):
            began = time.perf_counter()
            case, found, end = tried(seed, Path(folder))
            worst = {}
            for one in found:
                errors[one.invariant].append(one.error / one.allowed if one.allowed else one.error)
                if not one.holds:
                    failed[one.invariant].append(seed)
                    worst[one.invariant] = f"{one.error:.1e} (allowed {one.allowed:.0e})"
            if end:
                ends[end.split(":")[0]].append(seed)
            if worst or end:
                told = "; ".join(f"{name} {value}" for name, value in worst.items())
                print(
                    f"scene {seed} ({time.perf_counter() - began:.0f} s): {case}: {told} {end}",
                    flush=True,
                )
    print(f"{choice.scenes} scenes; {dict(ends)}")
    for name, values in errors.items():
        print(
            f"{name}: {len(values)} checks, {len(failed[name])} failed {failed[name]}, the median"
            f" {np.median(values):.1e}, the largest {max(values):.1e} of what is allowed"
        )
    sys.exit(1 if any(failed.values()) or "DEFECT" in ends else 0)


if __name__ == "__main__":
    main()
