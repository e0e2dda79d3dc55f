"""`sainet tune gp`: fit a Gaussian process, around an engine identified if need be."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast, get_args

from sainet.cli.devices import use_devices
from sainet.cli.output import Json, Output, progress_bar
from sainet.learning.recipes import FROM_ENGINE
from sainet.models.identity import Features, ProcessFeatures
from sainet.runs.documents import checked
from sainet.runs.errors import BadSetting, require_one_of

if TYPE_CHECKING:
    from sainet.engines.simulator import InternalEngine
    from sainet.models.process_card import ProcessSettings

Given = Mapping[str, object]
_OF_PROCESSES = {"choose", "features", "iterations", "seed"}
_UNUSED = {
    "start": FROM_ENGINE,
    "devices": None,
    "members": None,
}  # options, as they are without use


@dataclass(frozen=True)
class ProcessJob:
    """A Gaussian process to fit, and on which pushes."""

    data: Path
    out: Path
    engine: str | None  # identified parameters, or a simulator; None: identify
    group: str | None  # None: all
    pushes: int | None  # from the start of the dataset; None: all

    def run(self, changes: Given, usual: Given, output: Output) -> Json:
        """Fit the process, with a progress bar.

        Args:
            changes: settings of any kind of model that were given.
            usual: defaults of all settings.
            output: of the command.

        Returns:
            The JSON object of the command.

        Raises:
            BadSetting: one is a setting of networks.
        """
        use_devices(None)
        from sainet.datasets.store import open_part
        from sainet.learning.process import fit_process, fits_of
        from sainet.models.library import find_internal_engine
        from sainet.models.process_card import read_process_card

        settings = _settings(changes, usual)
        store = open_part(self.data, self.group, self.pushes)

        def identify(folder: Path) -> "InternalEngine":
            from sainet.identification.identify import identify_into

            advance(0, "identifying the engine")
            return identify_into(store, folder).engine

        title = f"Fitting to {store.info.pushes} pushes"
        total = fits_of(store, settings)
        with progress_bar(title, total, output) as advance:
            fit_process(
                store,
                self.out,
                identify if self.engine is None else find_internal_engine(self.engine),
                settings,
                on_output=lambda: advance(1, ""),
            )
        card = read_process_card(self.out)
        if settings.choose:
            found = card.recipe
            output.say(f"Chosen: features {found.features}, kernel {found.kernel}")
        output.say(f"The Gaussian process of {card.trained_pushes} pushes: {self.out}")
        return {"out": str(self.out), "model": "gp", "loss": card.final_loss}


def _settings(changes: Given, usual: Given) -> "ProcessSettings":
    from sainet.models.process_card import ProcessSettings

    for name, value in changes.items():
        if name not in _OF_PROCESSES and value != {**usual, **_UNUSED}[name]:
            raise BadSetting(name, value, "left out: it is a setting of networks")
    names = get_args(ProcessFeatures)
    require_one_of("features", str(changes.get("features", names[0])), names)
    given = {name: changes[name] for name in _OF_PROCESSES & changes.keys()}
    return checked(ProcessSettings(**cast(Any, given)), "gp")


def for_networks(changes: Given) -> Given:
    """Return settings of a network.

    Raises:
        BadSetting: its features are those of a process, or are to be chosen.
    """
    features = changes.get("features", "paper")
    if features not in get_args(Features):
        raise BadSetting("features", features, "paper, place or contact for a network")
    if changes["choose"]:
        raise BadSetting("choose", True, "left out: it is a setting of gp")
    return {name: value for name, value in changes.items() if name != "choose"}
