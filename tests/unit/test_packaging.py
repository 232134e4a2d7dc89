"""What packages the program agrees with pyproject.toml."""

import re
import tomllib
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
RECIPE = yaml.safe_load((ROOT / "packaging" / "conda-recipe.yaml").read_text(encoding="utf-8"))
NAMES = {"matplotlib": "matplotlib-base"}
"""By the name on PyPI, that on conda-forge, where it is another."""


def bounds(requirements):
    """Return the bounds of each library: those of pip and of conda are written alike but for spaces."""
    parted = [re.match(r"([\w.-]+)\s*(.*)", line).groups() for line in requirements]
    return {NAMES.get(name.lower(), name.lower()): limits.replace(" ", "") for name, limits in parted}


def test_the_recipe_needs_what_the_wheel_needs():
    needed = bounds(PROJECT["dependencies"])
    recipe = bounds(RECIPE["requirements"]["run"])
    assert recipe.pop("python") == PROJECT["requires-python"]
    assert recipe == needed


def test_versions_agree():
    assert RECIPE["package"]["version"] == PROJECT["version"]
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["version"] == PROJECT["version"]


def test_entry_points_agree():
    scripts = [f"{name} = {place}" for name, place in PROJECT["scripts"].items()]
    assert RECIPE["build"]["python"]["entry_points"] == scripts


def test_the_container_copies_what_is_there():
    text = (ROOT / "Containerfile").read_text(encoding="utf-8")
    for line in re.findall(r"^COPY (?:--\S+ )?(.*) \S+$", text, re.MULTILINE):
        for name in line.split():
            assert (ROOT / name).exists(), name


def test_workflows_and_forms_are_yaml():
    files = sorted((ROOT / ".github").rglob("*.yml"))
    assert len(files) >= 4
    for path in files:
        assert isinstance(yaml.safe_load(path.read_text(encoding="utf-8")), dict), path.name
