# SPDX-License-Identifier: GPL-3.0-or-later
"""Where policies are kept from run to run: in the extension's own user folder."""

from __future__ import annotations

import bpy

from ..policy_cache import PolicyCache
from . import user_preferences

#: Without preferences (the extension runs from its source folder), megabytes.
DEFAULT_LIMIT_MB = 200


def policy_cache(context: bpy.types.Context) -> PolicyCache:
    """The cache of this user."""
    chosen = user_preferences.get(context)
    limit = chosen.policy_limit if chosen else DEFAULT_LIMIT_MB
    return PolicyCache(user_preferences.folder("policies"), limit * 1_000_000)
