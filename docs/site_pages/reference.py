"""Text of the generated pages: commands, Python names, networks, and project files."""

import ast
import contextlib
import io
import os
import re
from collections.abc import Iterator
from pathlib import Path

import sainet
from sainet.cli.entry import parse
from sainet.datasets.schema import StoreInfo, variables
from sainet.models.card import CARD, WEIGHTS, Card, read_card
from sainet.models.library import PRETRAINED, SHIPPED
from sainet.scenes.scene import TIME_STEP

ROOT = Path(__file__).parents[2]
_PANEL = re.compile(r"^╭─ (.+?) ─*╮$")
_COMMAND = re.compile(r"^ *• ([a-z-]+)")
# The order of the Python interface: the layers from scenes upwards.
_HOMES = {
    "Programs in a few lines": ("sainet.api",),
    "Scenes, states and pushes": ("sainet.scenes",),
    "Engines": ("sainet.engines",),
    "Datasets": ("sainet.datasets",),
    "Models": ("sainet.models",),
    "Training and identification": ("sainet.learning", "sainet.identification"),
    "Evaluation": ("sainet.evaluation",),
    "Planning and control": ("sainet.planning", "sainet.control", "sainet.tasks"),
}


def project_file(name: str) -> str:
    """Return the text of a file of the project below its title, for a page in docs/."""
    text = (ROOT / name).read_text("utf-8").partition("\n")[2]
    return text.replace("](docs/", "](")


def public_homes() -> dict[str, str]:
    """Return the module of every public name of the package."""
    stub = Path(sainet.__file__).with_suffix(".pyi").read_text("utf-8")
    return {
        alias.name: node.module
        for node in ast.parse(stub).body
        if isinstance(node, ast.ImportFrom) and node.module
        for alias in node.names
    }


def python_interface() -> str:
    """Return the documentation of every public name, by layer."""
    homes, parts = public_homes(), []
    for title, prefixes in _HOMES.items():
        names = [n for n, home in homes.items() if home.startswith(prefixes)]
        if names:
            entries = "\n".join(map(_documented, sorted(names)))
            parts.append(f"## {title}\n\n```{{eval-rst}}\n{entries}```\n")
    return "\n".join(parts)


def _documented(name: str) -> str:
    item = getattr(sainet, name)
    kind = "autoclass" if isinstance(item, type) else "autofunction"
    members = "   :members:\n" if isinstance(item, type) else ""
    return f".. {kind}:: sainet.{name}\n{members}"


def command_line() -> str:
    """Return the help of every command, as lists of options."""
    return "\n".join(_command_pages((), 2))


def _command_pages(words: tuple[str, ...], level: int) -> Iterator[str]:
    lines = _help(words)
    if words:
        yield f"{'#' * level} `sainet {' '.join(words)}`\n"
        level += 1
    yield f"```text\n{lines[0]}\n```\n" if words else ""
    text, panels = _panels(lines[1:])
    yield _escaped("\n".join(text).strip()) + "\n" if words else ""
    nested: list[str] = []
    for title, rows in panels:
        if title == "subcommands":
            nested = [found[1] for row in rows if (found := _COMMAND.match(row))]
            continue
        entries = "\n".join(_entries(rows)) if words else ""
        if entries:
            yield f"**{title.capitalize()}**\n\n{entries}\n"
    for name in nested:
        yield from _command_pages((*words, name), level)


def _help(words: tuple[str, ...]) -> list[str]:
    """Return the lines of the help of a command."""
    out = io.TextIOWrapper(io.BytesIO(), encoding="utf-8")
    before = os.environ.get("COLUMNS")
    os.environ["COLUMNS"] = "120"
    try:
        with contextlib.redirect_stdout(out), contextlib.suppress(SystemExit):
            parse([*words, "--help"])
    finally:
        os.environ.pop("COLUMNS")
        if before is not None:
            os.environ["COLUMNS"] = before
    out.seek(0)
    return out.read().splitlines()


def _panels(lines: list[str]) -> tuple[list[str], list[tuple[str, list[str]]]]:
    """Return the text above the panels, and the title and the rows of each panel."""
    text: list[str] = []
    panels: list[tuple[str, list[str]]] = []
    inside = False
    for line in lines:
        found = _PANEL.match(line)
        if found:
            panels.append((found[1], []))
            inside = True
        elif line.startswith("╰"):
            inside = False
        elif inside:
            panels[-1][1].append(line[2:-1].rstrip())
        else:
            text.append(line)
    return text, panels


def _entries(rows: list[str]) -> Iterator[str]:
    """Return Markdown list items: the option, then its meaning."""
    items: list[list[str]] = []
    # Above a rule stands the text of the whole panel.
    rules = [index for index, row in enumerate(rows) if row.startswith("──")]
    for row in rows[rules[-1] + 1 if rules else 0 :]:
        if row[:1] not in ("", " "):
            name, _, meaning = row.partition("  ")
            items.append([name, meaning])
        elif items:
            items[-1].append(row)
    for name, *texts in items:
        meaning = " ".join(text.strip() for text in texts if text.strip())
        if name != "-h, --help":
            yield f"- `{name}`: {_escaped(meaning)}"


def _escaped(text: str) -> str:
    return re.sub(r"([*_<>\[\]{}$|])", r"\\\1", text)


def model_zoo() -> str:
    """Return a card for each network of the package."""
    return "\n".join(map(_card, SHIPPED))


def _card(name: str) -> str:
    card = read_card(PRETRAINED / name)
    rows = "\n".join(f"| {key} | {value} |" for key, value in _facts(name, card))
    return f"## `{name}`\n\n{card.identity.label}.\n\n| | |\n| :-- | :-- |\n{rows}\n"


def _facts(name: str, card: Card) -> Iterator[tuple[str, str]]:
    yield "kind", f"`{card.identity.kind}`"
    yield "setup of the pushes", card.kind
    yield "internal engine", _engine(card)
    yield (
        "training data",
        f"{card.trained_pushes:,} pushes simulated by {card.truth_engine}",
    )
    yield "disks in each push", str(card.disks)
    yield "time step", f"1/{round(1 / card.time_step)} s"
    recipe = card.recipe
    yield (
        "training",
        f"{recipe.iterations:,} iterations, {recipe.batch_size} pushes a batch, "
        f"{recipe.steps} steps a push, learning rate {recipe.learning_rate:g}, "
        f"l2 {recipe.l2:g}",
    )
    yield (
        "started from",
        f"`{card.started_from[:12]}`" if card.started_from else "random weights",
    )
    if card.final_loss is not None:
        yield "final training loss", f"{card.final_loss:.3g}"
    machine = card.manifest
    size = (PRETRAINED / name / WEIGHTS).stat().st_size
    yield (
        "trained on",
        f"{machine.processor}, {machine.cores} cores, Python {machine.python}",
    )
    yield (
        "weights",
        f"`{card.weights[:12]}`, {size:,} bytes",
    )
    yield (
        "card",
        f"`{name}/{CARD}` in the folder `sainet/models/pretrained` of the package",
    )


def _engine(card: Card) -> str:
    simulator = card.identity.simulator
    if simulator is None:
        return "none"
    assumed = simulator.assumptions
    masses = " and ".join(f"{mass:g}" for mass in assumed.mass or ())
    radii = " and ".join(f"{1000 * radius:g}" for radius in assumed.radius or ())
    return (
        f"{simulator.engine}, assumed masses {masses} kg, radii {radii} mm, "
        f"table friction {assumed.table_friction}"
    )


def dataset_arrays() -> str:
    """Return the arrays of a dataset with every optional part, as a table."""
    info = StoreInfo(
        kind="robot",
        pushes=1,
        bodies=2,
        steps=1,
        chunk_size=1,
        time_step=TIME_STEP,
        engine="planar",
        assumed_engines=("planar",),
        has_measurements=True,
        has_repeats=True,
    )
    rows = (
        f"| `{name}` | [{', '.join(each.dimensions)}] | {each.units} | {each.meaning} |"
        for name, each in variables(info).items()
    )
    return "\n".join(
        ["| array | axes | unit | meaning |", "| :-- | :-- | :-- | :-- |", *rows]
    )
