"""Monte Carlo: is the engine as good as it says? Many simulated runs, each with its own start, sensor errors and noise.

::

    recipe_from(name or file) -> recipe      of a scenario or a project    (scenario_recipe)
    recipe(seed)              -> Case        what one run needs            (recipes)
    run_case(Case)            -> RunRecord   filter, smoother, errors      (single)
    run_campaign(recipe, ...) -> Campaign    all runs, on several cores    (campaign)
    assess(Campaign)          -> Assessment  NEES, NIS, RMSE, verdict      (assessment)
    montecarlo(recipe, DIR)   -> all of it, written as tables, summary.json and plots  (output)
"""

from navfuse.montecarlo.assessment import Assessment, assess
from navfuse.montecarlo.campaign import Campaign, run_campaign
from navfuse.montecarlo.output import describe, montecarlo, write_campaign
from navfuse.montecarlo.recipes import Case, SimulatedRecipe, Tampering
from navfuse.montecarlo.scenario_recipe import ProjectRecipe, ScenarioRecipe, recipe_from
from navfuse.montecarlo.single import RunRecord, run_case

__all__ = [
    "Assessment",
    "Campaign",
    "Case",
    "ProjectRecipe",
    "RunRecord",
    "ScenarioRecipe",
    "SimulatedRecipe",
    "Tampering",
    "assess",
    "describe",
    "montecarlo",
    "recipe_from",
    "run_campaign",
    "run_case",
    "write_campaign",
]
