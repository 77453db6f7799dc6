"""Files that are read, and what they hold."""

from __future__ import annotations

import functools
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from botohe_moo._base.checks import FaultsError
from botohe_moo._base.files import read_bytes
from botohe_moo._base.types import FilePath

if TYPE_CHECKING:
    from botohe_moo._base.document import Document


class Source:
    """A file that is read: its path, its bytes, and its content as text, JSON or YAML.

    Examples
    --------
    >>> from botohe_moo import load_mission, save_mission
    >>> from botohe_moo.mission import Source
    >>> save_mission(load_mission("toy"), "site.json")
    >>> Source("site.json").json["graph"]["name"]
    'toy'
    """

    def __init__(self, path: FilePath) -> None:
        self.path = Path(path)

    @functools.cached_property
    def data(self) -> bytes:
        """The bytes of the file; a FaultsError names one that cannot be read."""
        try:
            return read_bytes(self.path)
        except FileNotFoundError:
            fault = "there is no such file"
        except OSError as error:
            fault = f"cannot be read: {error.strerror}"
        raise FaultsError(fault, str(self.path))

    @functools.cached_property
    def text(self) -> str:
        """The file as a text in UTF-8; a UnicodeDecodeError if it is not UTF-8."""
        return self.data.decode("utf-8-sig")

    @functools.cached_property
    def json(self) -> Any:
        """The content of a JSON file; a ValueError if it is not JSON."""
        try:
            return json.loads(self.text)
        except json.JSONDecodeError as error:
            raise ValueError(f"expected JSON: {error}") from None

    @functools.cached_property
    def yaml(self) -> Document:
        """The content of a YAML file, with lines of values; a ValueError if it is not YAML."""
        # Imported late: it takes time, and most missions are not in YAML.
        from botohe_moo._base.document import Document, DocumentError

        try:
            return Document(self.text)
        except DocumentError as error:
            raise ValueError(f"line {error}") from None
