# SPDX-License-Identifier: GPL-3.0-or-later
"""Where policies are kept from run to run: in the extension's own user folder."""

from __future__ import annotations

from pathlib import Path

import bpy

from ..policy_cache import PolicyCache
from . import user_preferences

#: Without preferences (the extension runs from its source folder), megabytes.
DEFAULT_LIMIT_MB = 200


def policy_cache(context: bpy.types.Context) -> PolicyCache:
    """The cache of this user."""
    try:
        folder = Path(bpy.utils.extension_path_user(user_preferences.PACKAGE, path="policies"))
    except ValueError:  # not installed as an extension
        folder = Path(bpy.utils.user_resource("DATAFILES", path="oncue")) / "policies"
    chosen = user_preferences.get(context)
    limit = chosen.policy_limit if chosen else DEFAULT_LIMIT_MB
    return PolicyCache(folder, limit * 1_000_000)
