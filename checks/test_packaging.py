"""Is what ``make dist`` has built ready for an index, for conda-forge and for citations?

Nothing is installed or downloaded here: files are compared with the metadata of the wheel.
"""

import configparser

import pytest
import yaml
from packaging.metadata import Metadata
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from trove_classifiers import classifiers as known_classifiers

from checks.test_dist import PROJECT, PYPROJECT, ROOT, SDIST, STEM, WHEEL, asked, contents

# What conda-forge calls the packages that have another name there.
CONDA_NAMES = {
    "matplotlib": "matplotlib-base",
    "moocore": "python-moocore",
    "seaborn": "seaborn-base",
}


def conda_requirement(wish):
    """Return name and versions of a requirement, as conda-forge has them."""
    name, versions = asked(wish)
    return CONDA_NAMES.get(name, name), versions


def parsed(line):
    """Return name and versions of a line of the recipe, such as ``numba >=0.61``."""
    name, _, versions = line.partition(" ")
    return name, SpecifierSet(versions)


def load_yaml(text):
    return yaml.safe_load(text)


@pytest.fixture(scope="module")
def packed():
    return contents(WHEEL)


@pytest.fixture(scope="module")
def metadata(packed):
    return Metadata.from_email(packed[f"{STEM}.dist-info/METADATA"], validate=True)


@pytest.fixture(scope="module")
def recipe():
    """The recipe, with what its context defines filled in."""
    text = (ROOT / "packaging" / "recipe.yaml").read_text("utf-8")
    for name, value in load_yaml(text)["context"].items():
        text = text.replace(f"${{{{ {name} }}}}", value)
    return load_yaml(text)


class TestMetadata:
    def test_classifiers_are_known_to_indexes(self, metadata):
        assert set(metadata.classifiers) <= set(known_classifiers)

    def test_classifiers_say_what_is_true(self, metadata, packed):
        assert "botohe_moo/py.typed" in packed
        assert "Typing :: Typed" in metadata.classifiers
        start = "Programming Language :: Python :: 3."
        minors = [text.removeprefix(start) for text in metadata.classifiers if start in text]
        assert metadata.requires_python == SpecifierSet(f">=3.{min(map(int, minors))}")
        assert not any(text.startswith("License ::") for text in metadata.classifiers)

    def test_licences_are_named_and_packed(self, metadata, packed):
        assert metadata.license_expression == PROJECT["license"]
        assert metadata.license_files == PROJECT["license-files"]
        for name in metadata.license_files:
            assert packed[f"{STEM}.dist-info/licenses/{name}"] == (ROOT / name).read_bytes()

    def test_what_an_index_shows_is_there(self, metadata):
        assert metadata.description_content_type == "text/markdown"
        assert metadata.description == (ROOT / "README.md").read_text("utf-8")
        assert metadata.author == PROJECT["authors"][0]["name"]
        assert set(metadata.keywords) == set(PROJECT["keywords"])
        assert 0 < len(metadata.summary) <= 512

    def test_the_citation_is_of_this_version(self, metadata):
        citation = load_yaml((ROOT / "CITATION.cff").read_text("utf-8"))
        _, header, _ = (ROOT / "paper" / "paper.md").read_text("utf-8").split("---\n", 2)
        assert citation["version"] == str(metadata.version)
        assert citation["title"] == load_yaml(header)["title"]
        assert citation["license"] in metadata.license_expression.split(" AND ")
        assert set(citation["keywords"]) == set(metadata.keywords)
        assert [one["name"] for one in citation["authors"]] == [metadata.author]


class TestRecipe:
    def test_it_is_of_this_version(self, recipe, metadata):
        assert recipe["package"] == {"name": metadata.name, "version": str(metadata.version)}
        assert recipe["build"]["noarch"] == "python"

    def test_it_builds_from_the_sdist(self, recipe):
        assert (ROOT / "packaging" / recipe["source"]["path"]).resolve() == SDIST.resolve()
        python, pip, *backend = recipe["requirements"]["host"]
        assert (python, pip) == (f"python {recipe['context']['python_min']}.*", "pip")
        wishes = [Requirement(wish) for wish in PYPROJECT["build-system"]["requires"]]
        assert list(map(parsed, backend)) == list(map(conda_requirement, wishes))

    def test_it_asks_for_what_the_wheel_asks_for(self, recipe, metadata):
        wanted = dict(map(parsed, recipe["requirements"]["run"]))
        assert wanted.pop("python") == metadata.requires_python
        assert wanted.pop("__unix") == SpecifierSet()
        assert not any("Windows" in text for text in metadata.classifiers)
        wishes = [wish for wish in metadata.requires_dist if wish.marker is None]
        assert wanted == dict(map(conda_requirement, wishes))

    def test_it_has_the_commands_of_the_wheel(self, recipe, packed):
        parser = configparser.ConfigParser(delimiters="=")
        parser.read_string(packed[f"{STEM}.dist-info/entry_points.txt"].decode())
        commands = [f"{name} = {target}" for name, target in parser["console_scripts"].items()]
        assert recipe["build"]["python"]["entry_points"] == commands

    def test_it_tests_what_is_there(self, recipe, packed):
        imports, commands = recipe["tests"]
        lowest = recipe["context"]["python_min"]
        assert imports["python"]["pip_check"] is True
        assert imports["python"]["python_version"][0] == f"{lowest}.*"
        for module in imports["python"]["imports"]:
            assert f"{module.replace('.', '/')}/__init__.py" in packed
        assert commands["script"] == ["botohe --version"]
        assert commands["requirements"]["run"] == [f"python {lowest}.*"]

    def test_it_says_what_the_metadata_say(self, recipe, metadata):
        assert metadata.summary.startswith(recipe["about"]["summary"])
        assert recipe["about"]["license"] == metadata.license_expression
        assert recipe["about"]["license_file"] == metadata.license_files
