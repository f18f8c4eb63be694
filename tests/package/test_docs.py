"""What the manual says that a program can check: keys, project files, commands, code, links."""

from __future__ import annotations

import ast
import importlib
import importlib.util
import re
import shlex
import tomllib
from pathlib import Path

import pytest
import typer

import navfuse
from navfuse.cli.app import app
from navfuse.config import DeadReckoningProject, Project, any_project, help_keys, load_project, template
from navfuse.data.result import STATUSES, Innovations
from navfuse.io.gnss_rows import DEFAULT_SD_POSITION
from navfuse.io.units import UNITS
from navfuse.simulation.scenario import read_scenario, scenario_names

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = ["README.md", *sorted(f"docs/{p.relative_to(DOCS).as_posix()}" for p in DOCS.glob("[!_]*.md"))]
PAGES += sorted(f"docs/decisions/{p.name}" for p in (DOCS / "decisions").glob("*.md"))
FENCE = re.compile(r"^```(\w+)\n(.*?)^```", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\]\(([^)#]+\.(?:md|py))(?:#[^)]*)?\)")
SMALLEST = {"imu": {"file": "imu.csv"}, "gnss": {"file": "gnss.csv"}}


def blocks(language: str) -> list[tuple[str, int, str]]:
    """Every code block of a language: page, number on the page, text."""
    found = []
    for page in PAGES:
        texts = [text for name, text in FENCE.findall((ROOT / page).read_text(encoding="utf-8")) if name == language]
        found += [(page, number, text) for number, text in enumerate(texts)]
    return found


def cases(language: str) -> list:
    return [pytest.param(text, id=f"{page}-{number}") for page, number, text in blocks(language)]


@pytest.fixture(scope="module")
def generated_list() -> str:
    """The list of keys as the manual is built with it."""
    spec = importlib.util.spec_from_file_location("manual_conf", DOCS / "conf.py")
    assert spec is not None
    conf = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(conf)
    return conf._project_file_keys()


def test_the_manual_has_pages_and_examples():
    assert {"README.md", "docs/engine.md", "docs/file-formats.md", "docs/api.md"} <= set(PAGES)
    assert min(len(blocks(language)) for language in ("toml", "python", "console")) >= 3


@pytest.mark.parametrize("entry", help_keys(), ids=lambda entry: entry.key)
def test_every_key_is_explained_in_the_manual(entry, generated_list):
    (found,) = [text for text in generated_list.split("\n\n") if text.startswith(f"`{entry.key}`")]
    head, kind, description = found.strip().split("\n")
    assert head == (f"`{entry.key}` [{entry.unit}]" if entry.unit else f"`{entry.key}`")
    assert entry.type in kind
    assert entry.default in kind
    assert description.strip() == entry.description


def test_the_keys_of_dead_reckoning_are_part_of_the_manual():
    spec = importlib.util.spec_from_file_location("manual_conf", DOCS / "conf.py")
    assert spec is not None
    conf = importlib.util.module_from_spec(spec)
    assert spec.loader is not None
    spec.loader.exec_module(conf)
    listed = conf._dead_reckoning_keys()
    own = [entry for entry in help_keys(DeadReckoningProject) if entry.key.startswith("dead_reckoning.")]
    assert listed.count("\n: ") == len(own) > 15
    page = (DOCS / "dead-reckoning.md").read_text(encoding="utf-8")
    assert "```{include} _generated/dead_reckoning_keys.md" in page


def test_the_list_of_keys_is_part_of_the_manual(generated_list):
    assert generated_list.count("\n: ") == len(help_keys())
    assert "```{include} _generated/keys.md" in (DOCS / "file-formats.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("text", cases("toml"))
def test_project_files_of_the_manual_are_valid(text, tmp_path):
    given = tomllib.loads(text)
    if "motion" in given:
        assert read_scenario(given, "manual").motion.end > 0.0
        return
    if "dead_reckoning" in given:
        assert any_project(given).output.formats
        return
    whole = {**SMALLEST, **{name: {**SMALLEST.get(name, {}), **table} for name, table in given.items()}}
    project = Project.from_dict(whole)
    for section, table in given.items():
        assert set(table) <= set(getattr(project, section).model_fields_set)
    if "imu" in given and "gnss" in given:
        (tmp_path / "project.toml").write_text(text, encoding="utf-8")
        assert load_project(tmp_path / "project.toml").imu.file == tmp_path / given["imu"]["file"]


def test_a_misspelt_project_file_of_the_manual_would_be_found():
    with pytest.raises(navfuse.ConfigError, match="unknown key"):
        Project.from_dict({**SMALLEST, "gnss": {"file": "gnss.csv", "lever_arm": [0.0, 0.0, 0.0]}})


def test_the_template_is_a_valid_project_file(tmp_path):
    (tmp_path / "project.toml").write_text(template(), encoding="utf-8")
    assert load_project(tmp_path / "project.toml").imu.file == tmp_path / "imu.parquet"


def commands(text: str) -> list[list[str]]:
    """The navfuse commands of a console block, split into words, up to a redirection."""
    lines = [line[2:].split("#")[0].split(">")[0] for line in text.splitlines() if line.startswith("$ ")]
    words = [shlex.split(line) for line in lines]
    return [line[1:] for line in words if line and Path(line[0]).name == "navfuse"]


@pytest.mark.parametrize("words", [w for _, _, text in blocks("console") for w in commands(text)], ids=" ".join)
def test_commands_of_the_manual_parse(words):
    group = typer.main.get_command(app)
    command = group.commands[words[0]]
    command.make_context(words[0], list(words[1:]))


@pytest.mark.parametrize("name", scenario_names())
def test_every_scenario_is_in_the_manual(name):
    assert f"`{name}`" in (DOCS / "simulation.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("text", cases("python"))
def test_code_of_the_manual_uses_names_that_exist(text):
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and str(node.module).startswith("navfuse"):
            module = importlib.import_module(str(node.module))
            assert all(hasattr(module, alias.name) for alias in node.names)
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "navfuse":
            assert node.attr in navfuse.__all__


@pytest.mark.parametrize("page", PAGES)
def test_links_between_pages_lead_somewhere(page):
    targets = LINK.findall((ROOT / page).read_text(encoding="utf-8"))
    for target in targets:
        if "://" not in target:
            assert ((ROOT / page).parent / target).is_file(), target


def test_columns_of_the_innovations_are_documented():
    page = (DOCS / "file-formats.md").read_text(encoding="utf-8")
    missing = [name for name in Innovations.empty().to_columns() if f"`{name}`" not in page]
    assert missing == ["z_2", "sd_2"]
    assert all(f"`{status}`" in page for status in STATUSES)


@pytest.mark.parametrize("quantity", UNITS)
def test_every_unit_is_documented(quantity):
    row = next(
        line
        for line in (DOCS / "file-formats.md").read_text(encoding="utf-8").splitlines()
        if line.startswith(f"| {quantity} |")
    )
    assert re.findall(r"`(\w+)`", row) == list(UNITS[quantity])


@pytest.mark.parametrize("fix", [fix for fix in DEFAULT_SD_POSITION if fix])
def test_default_deviations_of_fixes_are_documented(fix):
    rows = [
        line for line in (DOCS / "file-formats.md").read_text(encoding="utf-8").splitlines() if line.startswith("| `")
    ]
    row = next(line for line in rows if f"`{fix}`" in line and line.endswith(" m |"))
    assert tuple(map(float, re.findall(r"[\d.]+", row.split("|")[2]))) == DEFAULT_SD_POSITION[fix]


@pytest.mark.parametrize("name", [name for name in navfuse.__all__ if not name.startswith("_")])
def test_public_names_are_in_the_api(name):
    page = (DOCS / "api.md").read_text(encoding="utf-8")
    in_errors = hasattr(importlib.import_module("navfuse.errors"), name)
    assert f":: navfuse.{name}\n" in page or (in_errors and ":: navfuse.errors\n" in page)
