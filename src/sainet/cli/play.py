"""`sainet play`."""

from dataclasses import dataclass, field

from sainet.cli.devices import use_cache
from sainet.cli.output import Json, Output
from sainet.report.live.config import PlayConfig


@dataclass(frozen=True, kw_only=True)
class Play:
    """Open a live page: drag disks, compare predictions, push, and let a model plan."""

    config: PlayConfig = field(default_factory=PlayConfig)
    output: Output = field(default_factory=Output)

    def run(self) -> Json:
        """Serve the page until Ctrl-C."""
        use_cache()
        from sainet.report.live.server import serve

        addresses: list[str] = []

        def on_listening(address: str) -> None:
            addresses.append(address)
            self.output.say(f"Open {address} in a browser. Ctrl-C ends.")

        serve(self.config, on_listening=on_listening)
        return {"address": addresses[0], "episodes": str(self.config.out)}
