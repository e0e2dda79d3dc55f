"""Training runs of studies on a GPU: those that are alike train at once."""

from collections.abc import Iterable
from typing import Any

from sainet.learning.log import loss_note
from sainet.learning.together import fit_together
from sainet.studies.runner import Runner, all_steps
from sainet.studies.steps import Step, Train

_MOST = 12  # networks at once


def train_alike(step: Train, among: Iterable[Step[Any]], runner: Runner) -> None:
    """Train a network, and those of other steps that differ from it in seed or data.

    What they are trained on is made first.

    Args:
        step: of the network.
        among: steps that have not run.
        runner: of all of them.
    """
    form = _form(step)
    alike = [each for each in among if isinstance(each, Train) and _form(each) == form]
    chosen = [step, *(each for each in alike if each.key != step.key)][:_MOST]
    jobs = []
    for each in chosen:
        for needed in all_steps(each.inputs).values():
            runner.result(needed)
        if job := each.begin(runner):
            jobs.append(job)
    if not jobs[1:]:
        return
    title = f"Training {step.name} and {len(jobs) - 1} more"
    with runner.bar(title, step.iterations) as bar:
        fit_together(jobs, lambda done, loss: bar.reach(done, loss_note(loss)))


def _form(step: Train) -> tuple[object, ...]:
    """Return what networks have in common that can train at once."""
    recipe = step.recipe
    plain = recipe.changed(seed=0, l2=0.0)
    is_plain = type(step) is Train and step.start is None and step.identified is None
    return step.id.kind, plain, None if is_plain else step.key
