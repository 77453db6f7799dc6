"""The paper has the form that its journal asks for, and says where its claims are found."""

import datetime as dt
import re

import pytest
import yaml

from tests.docs.guides import ROOT

PAPER = ROOT / "paper" / "paper.md"
SECTIONS = [
    "Summary",
    "Statement of need",
    "State of the field",
    "Software design",
    "Research impact statement",
    "AI usage disclosure",
    "Acknowledgements",
    "References",
]
COMMENT = re.compile(r"<!--(.*?)-->", re.S)
CITED = "and the works cited"


@pytest.fixture(scope="module")
def paper():
    """The header, and the text below it."""
    empty, header, text = PAPER.read_text("utf-8").split("---\n", 2)
    assert empty == ""
    return yaml.safe_load(header), text


def test_the_header_is_complete(paper):
    header, _ = paper
    assert {"title", "tags", "authors", "affiliations", "date", "bibliography"} == set(header)
    assert "`" not in header["title"]
    assert dt.datetime.strptime(header["date"], "%d %B %Y")
    assert (PAPER.parent / header["bibliography"]).exists()
    indices = {str(one["index"]) for one in header["affiliations"]}
    for author in header["authors"]:
        assert set(re.findall(r"\w+", str(author["affiliation"]))) <= indices


def test_the_sections_are_those_of_the_journal(paper):
    assert re.findall(r"^# (.*)$", paper[1], re.M) == SECTIONS


def test_the_length_is_within_limits(paper):
    assert 750 <= len(COMMENT.sub("", paper[1]).split()) <= 1750
    assert max(map(len, PAPER.read_text("utf-8").splitlines())) <= 120


def test_citations_and_bibliography_agree(paper):
    bibliography = (PAPER.parent / paper[0]["bibliography"]).read_text("utf-8")
    keys = re.findall(r"^@\w+\{([^,\s]+),$", bibliography, re.M)
    assert len(set(keys)) == len(keys)
    cited = re.findall(r"@([\w:-]+)", COMMENT.sub("", paper[1]))
    assert set(cited) == set(keys)
    for entry in re.split(r"^(?=@)", bibliography, flags=re.M)[1:]:
        fields = set(re.findall(r"^  (\w+) *=", entry, re.M))
        assert {"author", "title", "year"} <= fields, entry
        assert {"doi", "url"} & fields, entry


def test_every_paragraph_says_where_its_claims_are_found(paper):
    blocks = [block for block in re.split(r"\n\n+", paper[1].strip()) if block[0] != "#"]
    for text, comment in zip(blocks[::2], blocks[1::2], strict=True):
        assert not COMMENT.search(text), text
        assert COMMENT.sub("", comment).strip() == "", comment


def test_the_files_named_are_there(paper):
    sources = [text for text in COMMENT.findall(paper[1]) if text.startswith(" Sources: ")]
    assert sources
    for text in sources:
        for name in re.split(r",\s*", text.removeprefix(" Sources: ").strip()):
            assert name == CITED or (ROOT / name).exists(), name
