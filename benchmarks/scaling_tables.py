"""The tables that `scaling.py` prints."""

import math
from collections.abc import Iterable

from scaling_model import Iteration, Machine, improved, traffic


def show_bandwidth(rates: dict[int, dict[str, float]]) -> None:
    """Print what ranks get of the memory, and what share of it two that work at once lose."""
    print("memory bandwidth of all ranks at once [GB/s], bytes counted as STREAM does")
    print("ranks   triad     dot")
    for ranks, rate in rates.items():
        print(f"{ranks:5d} {rate['triad'] / 1e9:7.1f} {rate['dot'] / 1e9:7.1f}")
    shares = " and ".join(f"{ceiling(rates, 2, name):.0%} ({name})" for name in ("triad", "dot"))
    print(f"two cores get {shares} of twice what one gets: the ceiling of their efficiency")


def ceiling(rates: dict[int, dict[str, float]], ranks: int, name: str = "triad") -> float:
    """Return the parallel efficiency of work that waits for memory alone."""
    return min(1.0, rates[ranks][name] / (ranks * rates[1][name]))


def show_times(title: str, facts: list[dict], rates: dict, weak: bool) -> None:
    """Print times and efficiencies; the first row is the measure of the others.

    The floor is the share of the solve that its products' bytes alone take as a stream.
    """
    print(f"\n{title}\nranks   unknowns  its", end="")
    names = list(facts[0]["seconds"])
    print("".join(f" {name + ' [s]':>11s}" for name in names), end="")
    print("  efficiency of solve, of its ceiling   floor  kB/unknown")
    for fact in facts:
        gain = facts[0]["seconds"]["solve"] / fact["seconds"]["solve"]
        # a longer solve by more iterations is no loss of parallel efficiency: it is told beside
        efficiency = gain if weak else gain * facts[0]["ranks"] / fact["ranks"]
        moved = traffic(fact) * fact["dofs"] * fact["iterations"]
        floor = moved / rates[fact["ranks"]]["triad"]
        print(f"{fact['ranks']:5d} {fact['dofs']:10d} {fact['iterations']:4d}", end="")
        print("".join(f" {fact['seconds'][name]:11.2f}" for name in names), end="")
        print(f" {efficiency:20.0%} {efficiency / ceiling(rates, fact['ranks']):15.0%}", end="")
        print(f" {floor / fact['seconds']['solve']:7.0%}", end="")
        print(f" {fact['memory'] / fact['dofs'] / 1e3:11.2f}")


def show_counts(name: str, facts: list[dict]) -> None:
    """Print what an iteration takes, whatever the machine."""
    print(f"\nan iteration on the {name}, ranks may share cores; messages and kB of the busiest")
    print(
        "ranks   unknowns  its  messages       kB  reductions  imbalance  flops/unknown  ", end=""
    )
    print("kB/unknown of the fullest rank")
    for fact in facts:
        print(
            f"{fact['ranks']:5d} {fact['dofs']:10d} {fact['iterations']:4d} "
            f"{fact['messages']:9.1f} {fact['bytes'] / 1e3:8.1f} {fact['reductions']:11.1f} "
            f"{fact['imbalance']:10.3f} {fact['flops'] / fact['dofs']:14.0f} "
            f"{fact['memory_rank'] / 1e3:12.2f}"
        )


def show_levels(name: str, facts: Iterable[dict]) -> None:
    """Print what every grid takes of a cycle; time is that of the slowest rank."""
    print(f"\na cycle of the {name}, grid by grid, finest first; the last is solved directly")
    print("ranks  grid  unknowns  per rank  imbalance  neighbours  messages       kB  time")
    for fact in facts:
        whole = sum(level["seconds"] for level in fact["levels"])
        for grid, level in enumerate(fact["levels"]):
            print(
                f"{fact['ranks']:5d} {grid:5d} {level['unknowns']:9d} "
                f"{level['unknowns'] / fact['ranks']:9.0f} {level['imbalance']:10.3f} "
                f"{level['neighbours']:11.0f} {level['messages']:9.1f} "
                f"{level['bytes'] / 1e3:8.1f} {level['seconds'] / whole:5.0%}"
            )


def show_iterations(rows: Iterable[tuple[str, list[dict]]]) -> None:
    """Print iterations of conjugate gradients, and grids, over the unknowns; a row at a time."""
    print("\niterations to 1e-10 under one loaded patch (unknowns; grids)")
    for name, facts in rows:
        shown = (
            f"{fact['iterations']:4d} ({fact['dofs']:7d}; {len(fact['levels'])})" for fact in facts
        )
        print(f"{name:15s}", *shown, flush=True)


def show_check(seen: Iteration, facts: list[dict], smaller: dict) -> None:
    """Print what the model says of the ranks that were counted.

    Args:
        seen: The iteration, from 2 and 8 ranks.
        facts: Counts on all numbers of ranks.
        smaller: Counts of an eighth of the unknowns on 8 ranks.
    """
    print("\nan iteration of the busiest rank: said by boxes among boxes, and counted")
    print("ranks   messages: said, counted   kB: said, counted")
    for fact in facts[1:]:
        n, ranks = fact["dofs"], fact["ranks"]
        print(f"{ranks:5d} {seen.messages(n, ranks):15.0f} {fact['messages']:9.0f}", end="")
        print(f" {seen.sent(n, ranks) / 1e3:11.0f} {fact['bytes'] / 1e3:9.0f}")
    (larger,) = (fact for fact in facts if fact["ranks"] == smaller["ranks"])
    growth = (larger["bytes"] / smaller["bytes"], larger["dofs"] / smaller["dofs"])
    power = math.log(growth[0]) / math.log(growth[1])
    print(f"bytes on {smaller['ranks']} ranks grow with unknowns to the power {power:.2f}")


def show_model(title: str, seen: Iteration, on: Machine) -> None:
    """Print from how many unknowns per rank many ranks pay, and what is in their way."""
    print(f"\nmodel of the {title}: w = {seen.traffic:.0f} B, v = {seen.volume:.0f} B, ", end="")
    print(
        f"e = {seen.exchanges:.1f} × grids ({seen.grids} for {seen.unknowns} unknowns) + ", end=""
    )
    print(f"{seen.outside:.0f}, r = {seen.reductions:.1f}, f = {seen.factor / 1e3:.0f} kB;", end="")
    print(f" M = {on.memory:.0e} B/s, λ = {on.latency:.0e} s, o = {on.overhead:.0e} s, ", end="")
    print(f"β = {on.network:.0e} B/s")
    print("                           efficiency   unknowns for", end="")
    print("     at 50 %: time of an iteration and its parts [ms]")
    print("ranks   solver              at 10⁵ each   80 %    50 %     all    work", end="")
    print("  neighbours  faces  reductions  coarsest")
    for ranks in (10**3, 10**4, 10**5):
        for name, iteration in (("as it is", seen), ("with remedies", improved(seen))):
            most, half = (iteration.least(share, ranks, on) for share in (0.8, 0.5))
            parts = [1e3 * part for part in iteration.seconds(half, ranks, on).values()]
            share = iteration.efficiency(1e5, ranks, on)
            print(f"{ranks:6d}  {name:20s} {share:9.0%} {most:9.0f} {half:7.0f}", end="")
            print(f" {sum(parts):7.2f}", end="")
            print(" {:7.2f} {:11.2f} {:6.2f} {:11.2f} {:9.2f}".format(*parts))
