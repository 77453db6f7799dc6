"""The explorer: a front as one interactive page that needs no network."""

from typing import TYPE_CHECKING

from botohe_moo._base.lazy import lazy_names

if TYPE_CHECKING:
    from botohe_moo.explorer.page import explore as explore
    from botohe_moo.explorer.page import explorer_page as explorer_page

__getattr__, __dir__, __all__ = lazy_names(__name__)
