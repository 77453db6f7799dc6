"""Conformance: whether an algorithm or a mission of another package keeps what studies rest on."""

from typing import TYPE_CHECKING

from botohe_moo.base.runtime import lazy_names

if TYPE_CHECKING:
    from botohe_moo.testing.checking import check_plugin as check_plugin
    from botohe_moo.testing.checking import parametrize_with_checks as parametrize_with_checks
    from botohe_moo.testing.rules import CheckResult as CheckResult

__getattr__, __dir__, __all__ = lazy_names(__name__)
