"""Guards the house: what a reviewer would otherwise have to count by hand."""

import ast
import importlib
import io
import os
import pkgutil
import re
import subprocess
import sys
import time
import tokenize
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from support import REPOSITORY, SOURCE

LONGEST_MODULE = 300  # lines
LONGEST_BODY = 40  # lines
MOST_POSITIONAL = 5  # arguments
SLOWEST_HELP = 2.0  # s; 0.7 on a quiet machine, and this one may be busy

PICKLERS = {"pickle", "cPickle", "cloudpickle", "dill", "joblib", "marshal", "shelve"}
NETWORK = {"aiohttp", "ftplib", "http", "httpx", "requests", "socket", "urllib"}

Function = ast.FunctionDef | ast.AsyncFunctionDef
MODULES = sorted(SOURCE.rglob("*.py"))
every_module = pytest.mark.parametrize(
    "path", MODULES, ids=lambda path: path.relative_to(SOURCE).as_posix()
)


def functions(tree: ast.AST) -> Iterator[Function]:
    """Every function and method, nested ones too."""
    return (node for node in ast.walk(tree) if isinstance(node, Function))


def body_lines(function: Function) -> int:
    """Lines from the first statement after the docstring to the last."""
    documented = ast.get_docstring(function) is not None
    body = function.body[1:] if documented else function.body
    return (body[-1].end_lineno or 0) - body[0].lineno + 1 if body else 0


def positional(function: Function) -> list[str]:
    """Names of the arguments that a caller may pass by position."""
    arguments = function.args.posonlyargs + function.args.args
    names = [argument.arg for argument in arguments]
    return names[1:] if names[:1] in (["self"], ["cls"]) else names


def public(body: list[ast.stmt]) -> Iterator[Function | ast.ClassDef]:
    """Public functions and classes of a module, and public methods of those classes."""
    for node in body:
        named = isinstance(node, Function | ast.ClassDef)
        if named and not node.name.startswith("_"):
            yield node
            if isinstance(node, ast.ClassDef):
                yield from public(node.body)


def imports(tree: ast.AST) -> Iterator[str]:
    """Top-level names of everything that is imported, at any depth of the file."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            yield str(node.module).partition(".")[0]


@every_module
def test_a_module_is_short_and_its_functions_too(path: Path):
    text = path.read_text()
    lines = len(text.splitlines())
    assert lines <= LONGEST_MODULE, f"{lines} lines; is there a second noun in it?"
    found = list(functions(ast.parse(text)))
    long = {f.name: body_lines(f) for f in found if body_lines(f) > LONGEST_BODY}
    assert not long, f"functions of over {LONGEST_BODY} lines: {long}"
    wide = {f.name: n for f in found if len(n := positional(f)) > MOST_POSITIONAL}
    assert not wide, f"make some of these keyword-only: {wide}"


@every_module
def test_every_public_name_is_documented(path: Path):
    tree = ast.parse(path.read_text())
    bare = [node.name for node in public(tree.body) if not ast.get_docstring(node)]
    assert not bare
    assert ast.get_docstring(tree) or not tree.body, "the module has no docstring"


@every_module
def test_no_pickle_and_no_network(path: Path):
    tree = ast.parse(path.read_text())
    assert not set(imports(tree)) & (PICKLERS | NETWORK - allowed_network(path))
    keywords = [node.arg for node in ast.walk(tree) if isinstance(node, ast.keyword)]
    assert "allow_pickle" not in keywords, "NumPy's default, False, is what we want"


def allowed_network(path: Path) -> set[str]:
    """Modules of the network that a module may import: sockets, to reach a robot."""
    return {"socket"} if path.parent == SOURCE / "robots" / "wire" else set()


CONTROLS = {"PathControls", "ForceControls"}
STRING_TESTS = {"startswith", "endswith", "removeprefix", "removesuffix"}
LAYOUT = {tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT}
SILENT = LAYOUT | {tokenize.COMMENT, tokenize.ENCODING, tokenize.ENDMARKER}


def docstrings(tree: ast.AST) -> set[ast.Constant]:
    """Strings that stand as statements: docstrings, of fields too."""
    found = (node.value for node in ast.walk(tree) if isinstance(node, ast.Expr))
    return {each for each in found if isinstance(each, ast.Constant)}


def code_lines(path: Path) -> int:
    """Lines with code: no blanks, comments or docstrings."""
    text = path.read_text()
    lines: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in SILENT:
            lines |= set(range(token.start[0], token.end[0] + 1))
    for string in docstrings(ast.parse(text)):
        lines -= set(range(string.lineno, (string.end_lineno or 0) + 1))
    return len(lines)


def names(node: ast.AST) -> set[str]:
    """Names that occur in an expression."""
    return {each.id for each in ast.walk(node) if isinstance(each, ast.Name)}


def calls(tree: ast.AST) -> Iterator[ast.Call]:
    """Every call in a module."""
    return (node for node in ast.walk(tree) if isinstance(node, ast.Call))


def asks_kind_of_controls(tree: ast.AST) -> int:
    """Calls of isinstance that tell the kinds of controls apart."""
    return sum(
        isinstance(call.func, ast.Name)
        and call.func.id == "isinstance"
        and bool(names(call.args[1]) & CONTROLS)
        for call in calls(tree)
    )


def name_part_tests(tree: ast.AST) -> int:
    """Tests of the beginning or end of something called a model, a name or a slug."""
    return sum(
        isinstance(call.func, ast.Attribute)
        and call.func.attr in STRING_TESTS
        and re.search(r"model|name\b|slug|training", ast.unparse(call.func.value))
        is not None
        for call in calls(tree)
    )


def flags_in_strings(tree: ast.AST) -> int:
    """Strings, docstrings apart, that name an option of the command line."""
    strings = (node for node in ast.walk(tree) if isinstance(node, ast.Constant))
    free = set(strings) - docstrings(tree)
    return sum(bool(re.search(r"(^|\W)--[a-z]", str(node.value))) for node in free)


def has_untyped_dict(tree: ast.AST) -> bool:
    """Whether the module names dict[str, Any] or Mapping[str, Any]."""
    return bool(re.search(r"(dict|Mapping)\[str, Any\]", ast.unparse(tree)))


TREES = {path: ast.parse(path.read_text()) for path in MODULES}
# Names of files and archive members are tested in these folders.
READERS = {SOURCE / "datasets" / "recorded", SOURCE / "runs"}
MODELLING = [tree for path, tree in TREES.items() if not READERS & set(path.parents)]
# CSS variables and options of git look like ours.
NO_FLAGS = {
    SOURCE / "cli",
    SOURCE / "report" / "palette.py",
    SOURCE / "runs" / "manifest.py",
}
BELOW_CLI = [tree for p, tree in TREES.items() if not {p, p.parent} & NO_FLAGS]
TOOLS = sorted((REPOSITORY / "tools").glob("*.py"))
# What later issues add has limits of its own.
ROBOTS = (
    "robots/lab",
    "robots/changing",
    "robots/wire",
    "engines/mujoco/",
    "studies/lab",
    "evaluation/lab",
    "control/collect",
    "cli/record",
    "robots/__init__",
)
WAY_IN = (
    *(
        "api/",
        "control/gym",
        "control/worlds",
        "report/live",
        "cli/play",
        "report/pictures",
    ),
    *("report/pictures", "report/figures/overview", "models/push_inputs"),
    "bench/environments",
    # With lines that stood in models/library.py and cli/output.py before.
    *("models/model.py", "runs/progress.py"),
)

TRUST = (
    "learning/process",
    "models/fitted_process",
    "models/process_card",
    "models/correctors/process",
    "cli/process",
    "evaluation/coverage",
    # With lines that stood in models/library.py before.
    "evaluation/abstention",
    "evaluation/unlike",
    "api/abstention",
    "datasets/groups",
    "report/about_models",
    "studies/recorded_trust",
)

KERNELS = ("models/correctors/kernels",)
MJCF = ("api/mjcf",)
VALIDATION = (
    "datasets/folds",
    "studies/candidates",
    "studies/cross_validation",
    "studies/validation",
    "evaluation/recommendation",
    "report/recommending",
    "cli/cross_validate",
    "api/validation",
)
CHOOSING = (
    "learning/choosing",
    "cli/propose",
    "studies/active_choice",
    "studies/recorded_few",
)
ENSEMBLES = (
    "models/ensemble",
    "learning/ensemble",
    "studies/recorded_ensembles",
)
ADAPTATION = ("identification/adaptation", "studies/adaptation")

EXPECTED_COST = ("planning/expectation", "studies/expected_cost")
MARGINS = ("evaluation/margins",)
ANY_NUMBER = (
    "bench/disks",
    "models/contacts",
    "models/correctors/contact",
    # With lines that stood in learning/held.py before.
    "models/correctors/held",
    "learning/mixture",
    "report/figures/counts",
    "studies/any_number",
    "studies/control_any_number",
    "tasks/obstacles",
    "tasks/steering",
)
# The whole paper with one command: letter, feedforward networks, claims.
WHOLE_PAPER = (
    # With lines that stood in models/features.py before.
    "models/blocks",
    "datasets/fixed",
    "models/correctors/feedforward",
    "models/nominal",
    "evaluation/rulings",
    "studies/conclusions",
    "studies/durations",
    "studies/effort",
    "studies/feedforward",
    "studies/letter.py",
    "studies/properties",
    "studies/published_physics",
    "studies/reduced_setup",
    "studies/whole_report",
)
LETTER_LOSS = ("studies/letter_loss",)
MANY_MACHINES = (
    "evaluation/parts",
    "runs/executors",
    "runs/programs",
    "runs/shards",
    "studies/shares",
)
ENGINEER = (
    "cli/inspect",
    # With lines that stood in datasets/splits.py before.
    "datasets/chains",
    "datasets/doubts",
    "datasets/facts",
    "datasets/inspection",
    # With lines that stood in datasets/recorded/tables.py before.
    "datasets/recorded/problems",
    "datasets/recorded/units",
    "report/figures/recordings",
    "report/pages/inspection",
)
START = ("bench/start",)
SCREENING = ("planning/screening", "bench/screening")
ON_GPU = (
    "models/correctors/fused",
    # With lines that stood in learning/fit.py and learning/step.py before.
    "learning/job",
    "learning/sources",
    "learning/together",
    "studies/on_gpu",
)
# With lines that stood in studies/demo.py before.
PAGE_OF_EVALUATION = ("report/replays", "report/pages/evaluation")


def modules_of(prefixes: tuple[str, ...]) -> list[Path]:
    """Modules whose paths begin with one of these."""
    return [p for p in MODULES if p.relative_to(SOURCE).as_posix().startswith(prefixes)]


ADDED = modules_of(ROBOTS)
LATER = ADDED + modules_of(
    WAY_IN
    + TRUST
    + KERNELS
    + VALIDATION
    + ADAPTATION
    + CHOOSING
    + ENGINEER
    + PAGE_OF_EVALUATION
    + SCREENING
    + START
    + ON_GPU
    + ENSEMBLES
    + EXPECTED_COST
    + MARGINS
    + ANY_NUMBER
    + WHOLE_PAPER
    + LETTER_LOSS
    + MANY_MACHINES
)
REBUILT = [path for path in MODULES if path not in LATER]
# Lines in older modules that connect later features to them.
CONNECTIONS = {
    # Three lines stood in evaluation/coverage.py before.
    "Gaussian processes, regions and coverage": 88,
    "models that abstain": 33,
    "surfaces that change during an episode, choosing pushes in labs": 11,
    "adaptation": 25,
    "units and bad pushes of tables": 35,
    "expected costs in planners": 40,
    "cross-validation": 10,
    "choice of inputs and kernels, ensembles in cross-validation": 14,
    "ensembles": 62,
    "provenance of identified engines": 10,
    # Also types, shapes and ranges of scenes, states and controls: 68.
    "wrong arguments, settings without effect, full disks": 157,
    "models of a user's own in control": 34,
    # A figure on every page since: 34 more.
    "figures, main tables and headlines of pages of results": 116,
    # With lines that stood in runs/shards.py and studies/shares.py before.
    "hashes inside every kept file, evaluation on a scheduler": 78,
    "groups of one surface, claims with a margin": 24,
    "contact networks and arrangements of disks": 165,
    "obstacles and other target disks": 25,
    "episodes of several models side by side": 50,
    # Also durations, the report of all studies, and fewer training runs.
    "the whole paper": 262,
    "the unit of the loss, claims of several studies on a page": 10,
    "inputs between those by the letter and ours": 20,
    "steering of rows": 29,
    "screening of pushes": 20,
    "timing starts and own pushes, processes loaded on demand": 12,
    "pushes in two datasets, a split into another run": 14,
    "kinds of pushes in own tables, origins of datasets": 17,
    "planned pushes of any length, what reviews of all layers found": 44,
    "disks that the internal engine assumes wrongly": 22,
    # Blocks of angles that are cut nowhere, workers that come late, Ctrl-C at the
    # start, pushes known to an engine inside a model, steps that nothing observed,
    # values out of range in simulations, labels on pages.
    "what further reviews found": 134,
    "a shorter training beside the paper's recipe": 27,
    "pushes of many lengths, predicted and judged in few programs": 14,
    "an engine that keeps overlaps": 24,
    # Shares of datasets, trials and evaluations, the options of five commands, and
    # where steps run, which stood in studies/shares.py before.
    "many machines": 245,
}
# How to count, the limit today, and the target. A limit is lowered, never raised.
COUNTS = {
    "modules": (lambda: len(REBUILT), 168, 150),
    "code lines in src": (
        lambda: sum(map(code_lines, REBUILT)) - sum(CONNECTIONS.values()),
        15_244,
        11_000,
    ),
    "modules of laboratory and robot": (lambda: len(ADDED), 40, 40),
    "code lines of laboratory and robot": (
        lambda: sum(map(code_lines, ADDED)),
        3_000,
        3_000,
    ),
    "code lines of the way in": (
        lambda: sum(
            map(
                code_lines,
                set(modules_of(WAY_IN)) - set(modules_of(MJCF + VALIDATION + TRUST)),
            )
        ),
        # Models, steps and names of a user's own wherever one plans or identifies, and
        # what is said of wrong arguments: 126 lines more than before. Figures of errors
        # disk by disk and of ranges: 50 more. Leading axes of controls, bounds in
        # single precision, numbers of pushes and steps: 9. Predictions of pushes with
        # one hash, engines of one name, types of settings: 23. Shapes and ranges of
        # controls, what functions and datasets are given: 49.
        3_746,
        3_540,
    ),
    "code lines of engines from MJCF": (
        lambda: sum(map(code_lines, modules_of(MJCF))),
        162,
        162,
    ),
    "code lines of models that know how sure they are": (
        # Regions that are as large as errors nearby: 44 of them; the share of a
        # residual that is added: 25; warnings of few training pushes and of other
        # numbers of disks, which were in planning/: 31; residuals of zero, pushes whose
        # ends are not known, products in full precision, unknown ends of ratios: 7.
        lambda: sum(map(code_lines, modules_of(TRUST))),
        1_382,
        1_382,
    ),
    "code lines of kernels": (
        lambda: sum(map(code_lines, modules_of(KERNELS))),
        35,
        35,
    ),
    "code lines of cross-validation": (
        # Blocks of angles from the widest gap, folders of any surface: 13.
        lambda: sum(map(code_lines, modules_of(VALIDATION))),
        610,
        600,
    ),
    "code lines of choosing pushes": (
        lambda: sum(map(code_lines, modules_of(CHOOSING))),
        # With lines that stood in studies/data_efficiency.py before.
        407,
        407,
    ),
    "code lines of expected costs": (
        lambda: sum(map(code_lines, modules_of(EXPECTED_COST))),
        120,
        120,
    ),
    "code lines of ensembles": (
        lambda: sum(map(code_lines, modules_of(ENSEMBLES))),
        350,
        350,
    ),
    "code lines of adaptation": (
        # Pushes of any length: 4.
        lambda: sum(map(code_lines, modules_of(ADAPTATION))),
        251,
        250,
    ),
    "code lines of claims with a margin": (
        lambda: sum(map(code_lines, modules_of(MARGINS))),
        40,
        40,
    ),
    "code lines of any number of disks": (
        lambda: sum(map(code_lines, modules_of(ANY_NUMBER))),
        # Two counts before, 715 and 130. Contact networks around the engine with
        # assumed properties: 23. Features that vary in no dataset of a mixture: 5.
        # Obstacles that are drawn again: 1.
        844,
        850,
    ),
    "code lines of the whole paper": (
        lambda: sum(map(code_lines, modules_of(WHOLE_PAPER))),
        # The last 21: the figure of the published errors of Physics.
        1_236,
        1_236,
    ),
    "code lines of other losses by the letter": (
        lambda: sum(map(code_lines, modules_of(LETTER_LOSS))),
        40,
        40,
    ),
    "code lines of many machines": (
        lambda: sum(map(code_lines, modules_of(MANY_MACHINES))),
        480,
        480,
    ),
    "code lines of the engineer's path": (
        # Rounding that is no variation, times of the ends of a stroke: 10.
        # Disks that turn against their pushes: 12. Bad pushes to leave out: 2.
        lambda: sum(map(code_lines, modules_of(ENGINEER))),
        620,
        600,
    ),
    "code lines of the page of an evaluation": (
        lambda: sum(map(code_lines, modules_of(PAGE_OF_EVALUATION))),
        150,
        150,
    ),
    "code lines of timing starts": (
        lambda: sum(map(code_lines, modules_of(START))),
        105,
        105,
    ),
    "code lines of screening pushes": (
        # With the steps of each push, which were fixed: 2.
        lambda: sum(map(code_lines, modules_of(SCREENING))),
        137,
        137,
    ),
    "code lines of training on a GPU": (
        # Training that ends early only where it validates: 2. Members whose batches
        # differ in length: 16.
        lambda: sum(map(code_lines, modules_of(ON_GPU))),
        833,
        827,
    ),
    "code lines in tools": (lambda: sum(map(code_lines, TOOLS)), 150, 150),
    "isinstance on controls": (
        lambda: sum(map(asks_kind_of_controls, TREES.values())),
        0,
        0,
    ),
    "tests of parts of model names": (
        lambda: sum(map(name_part_tests, MODELLING)),
        0,
        0,
    ),
    "flags in strings below cli/": (
        lambda: sum(map(flags_in_strings, BELOW_CLI)),
        0,
        0,
    ),
    "modules with dict[str, Any]": (
        lambda: sum(map(has_untyped_dict, TREES.values())),
        6,
        6,
    ),
}


@pytest.mark.parametrize("what", COUNTS)
def test_counts_stay_below_their_limits(what: str):
    count, limit, target = COUNTS[what]
    found = count()
    print(f"{what}: {found}, target {target}")
    assert found <= limit, f"{what}: {found}, at most {limit}; the target is {target}"


def test_counters_count():
    tree = ast.parse(
        '''
def f(controls, name, error):
    """isinstance(controls, PathControls) and --flag in words do not count."""
    if isinstance(controls, PathControls | ForceControls) and name.endswith("-x"):
        raise error("give --force")
    found: dict[str, Any] = {"a--b": path.startswith("/")}
'''
    )
    assert asks_kind_of_controls(tree) == 1
    assert name_part_tests(tree) == 1
    assert flags_in_strings(tree) == 1
    assert has_untyped_dict(tree)


def test_blanks_comments_and_docstrings_are_no_code(tmp_path: Path):
    path = tmp_path / "module.py"
    path.write_text(
        '"""Doc.\n\nMore."""\n\n# why\nx = [\n    1,  # one\n\n]\n"""Field."""\n'
    )
    assert code_lines(path) == 3


def importable() -> list[str]:
    """Names of all modules but `__main__`, which would run the command line."""
    found = pkgutil.walk_packages([str(SOURCE)], prefix="sainet.")
    names = ["sainet", *(module.name for module in found)]
    return [name for name in names if not name.endswith("__main__")]


@pytest.mark.parametrize("name", importable())
def test_every_name_in_all_resolves(name: str):
    module = importlib.import_module(name)
    exported = getattr(module, "__all__", [])
    assert sorted(set(exported)) == sorted(exported), "a name stands there twice"
    missing = [export for export in exported if not hasattr(module, export)]
    assert not missing


def test_the_main_functions_are_public():
    verbs = {"generate", "fit", "predict", "evaluate", "identify"}
    verbs |= {"make_planner", "run_episode", "run_trials"}
    assert verbs <= set(importlib.import_module("sainet").__all__)


def in_a_fresh_python(code: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Runs code where nothing is imported yet, not even this conftest."""
    command = [sys.executable, "-W", "error", "-c", code, *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_importing_the_command_line_does_not_import_jax():
    code = "import sys, sainet, sainet.cli; print(sorted(sys.modules))"
    done = in_a_fresh_python(code)
    assert done.returncode == 0, done.stderr
    assert "'sainet.cli'" in done.stdout
    heavy = {"jax", "jaxlib", "xarray", "zarr", "matplotlib", "scipy"}
    assert not {name for name in heavy if f"'{name}'" in done.stdout}


def test_help_is_fast():
    code = "from sainet.cli import main; main()"
    seconds = []
    for _ in range(3):
        start = time.perf_counter()
        done = in_a_fresh_python(code, "--help")
        seconds.append(time.perf_counter() - start)
        assert done.returncode == 0, done.stderr
        assert "demo" in done.stdout
    assert min(seconds) < SLOWEST_HELP, seconds


def normal(name: str) -> str:
    """The one spelling of a distribution's name (PEP 503)."""
    return re.sub(r"[-_.]+", "-", name).lower()


LOCKS = ("requirements.lock", "requirements-dev.lock")


def pinned(lock: str) -> set[str]:
    """Names and versions in a lock."""
    text = (REPOSITORY / lock).read_text()
    return set(re.findall(r"^[a-z0-9-]+==[^\s;]+", text, re.MULTILINE))


def wanted(requirements: list[str]) -> set[str]:
    """Names of the distributions that these requirements are for."""
    return {normal(re.split(r"[\[><=;~! ]", each)[0]) for each in requirements}


@pytest.mark.parametrize("name", LOCKS)
def test_a_lock_has_only_names_versions_and_hashes(name: str):
    lines = (REPOSITORY / name).read_text().splitlines()
    entry = re.compile(r"[a-z0-9-]+==[\w.!+]+( ; .+)? \\")
    digest = re.compile(r"    --hash=sha256:[0-9a-f]{64}( \\)?")
    stray = [
        line
        for line in lines
        if not (line.startswith("#") or entry.fullmatch(line) or digest.fullmatch(line))
    ]
    assert not stray
    comments = " ".join(line for line in lines if line.startswith("#"))
    assert "://" not in comments and "index" not in comments


def test_locks_cover_every_dependency_and_no_torch():
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]
    base, dev = map(pinned, LOCKS)
    assert base <= dev, "run `make lock`"
    names = {name: {pin.partition("==")[0] for pin in pinned(name)} for name in LOCKS}
    extras = project["optional-dependencies"]
    assert wanted(project["dependencies"]) <= names["requirements.lock"]
    for extra in extras.values():
        assert wanted(extra) <= names["requirements-dev.lock"], "run `make lock`"
    assert not {pin for pin in dev if pin.startswith(("torch", "nvidia"))}
    # `make demo` installs this lock: no tests, no linters, no Bullet.
    left_out = wanted(extras["test"] + extras["dev"]) - {"hatchling", "pillow"}
    assert not left_out & names["requirements.lock"]


def test_the_version_is_the_same_everywhere():
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]
    assert importlib.import_module("sainet").__version__ == project["version"]
    changelog = (REPOSITORY / "CHANGELOG.md").read_text()
    assert project["version"] in changelog


def test_scripts_for_the_shell_are_executable():
    for name in (".ci/run", "tools/setup.sh"):
        assert os.access(REPOSITORY / name, os.X_OK), name
