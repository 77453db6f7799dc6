"""The library: missions with their best known fronts and certified bounds."""

from typing import TYPE_CHECKING

from botohe_moo.base.runtime import lazy_names

if TYPE_CHECKING:
    from botohe_moo.library.files import Added as Added
    from botohe_moo.library.files import add_plans as add_plans
    from botohe_moo.library.files import best_known as best_known
    from botohe_moo.library.files import certified_bound as certified_bound
    from botohe_moo.library.files import check_library as check_library
    from botohe_moo.library.files import library_table as library_table
    from botohe_moo.library.fronts import BestKnown as BestKnown
    from botohe_moo.library.fronts import Finder as Finder
    from botohe_moo.mission.loading import library_names as library_names

__getattr__, __dir__, __all__ = lazy_names(__name__)
