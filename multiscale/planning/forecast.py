"""What a run is predicted to take, before anything expensive."""

from __future__ import annotations

from micro import HalfSpaceModel
from multiscale.costs.prediction import Cost, predicted_cost
from multiscale.machine.rates import this_machine
from multiscale.setup.problem import ProblemSetup


def forecast(setup: ProblemSetup) -> Cost:
    """Predict what a run takes.

    Args:
        setup: The scene's ingredients.
    """
    return predicted_cost(setup, this_machine())


def cost_statement(made: Cost) -> str:
    """Say what a run is predicted to take.

    Args:
        made: The prediction.
    """
    phases = ", ".join(f"{phase} {seconds:.2g}" for phase, seconds in made.seconds.items())
    return f"about {made.total:.2g} s on one core ({phases}) and {made.memory / 1e6:.0f} MB"


def error_statement(setup: ProblemSetup) -> str:
    """Say how the run will know its error.

    Args:
        setup: The scene's ingredients.
    """
    check = setup.scene.output.check
    if setup.meshes is not None:
        if len(setup.meshes.shapes) > 1:
            return "the meshes of the reference tell it, at every load step"
        return "not known: one mesh has no error bar (reference.meshes = 2)"
    if not isinstance(setup.micro, HalfSpaceModel):
        return f"not known: {setup.model.name} contacts have no measure of it, half-space has"
    if check == "none":
        return "not measured (output.check = 'none')"
    which = "every load step" if check == "all" else "the last load step"
    causes = "grid, slopes"
    causes += ", body" if setup.has_block else "; a block is not thought of"
    causes += " and laws" if setup.uses_laws else ""
    return f"measured at {which}, by cause: {causes}"
