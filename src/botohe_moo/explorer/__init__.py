"""The explorer: a front, or a mission that was played, as one page that needs no network."""

from typing import TYPE_CHECKING

from botohe_moo.base.runtime import lazy_names

if TYPE_CHECKING:
    from botohe_moo.explorer.page import explore as explore
    from botohe_moo.explorer.page import explorer_page as explorer_page
    from botohe_moo.explorer.page import replay as replay
    from botohe_moo.explorer.page import replay_page as replay_page

__getattr__, __dir__, __all__ = lazy_names(__name__)
