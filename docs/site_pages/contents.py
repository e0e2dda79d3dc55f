"""The order of the pages, and the pages whose programs run."""

CONTENTS = {
    "Start": ["install", "quick-start", "is-learning-worth-it"],
    "Tutorials": ["tutorial-data", "tutorial-control", "tutorial-model"],
    "Guides": [
        "importing",
        "tuning",
        "reproduce",
        "many-machines",
        "virtual-lab",
        "robot",
        "troubleshooting",
        "faq",
    ],
    "How it works": [
        "how-it-works",
        "engine",
        "training",
        "control-method",
        "metrics",
        "conventions",
        "choices",
        "limits",
    ],
    "Results": ["results/index", "benchmark", "benchmarks"],
    "Reference": ["models", "cli", "api", "data-format", "glossary"],
    "Project": ["contributing", "changelog", "citing", "releasing", "licences"],
}

# The Python and the commands on these pages run in order, in an empty folder.
EXECUTED = {"quick-start", "tutorial-data", "tutorial-control", "tutorial-model"}
