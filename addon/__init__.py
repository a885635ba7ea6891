# SPDX-License-Identifier: GPL-3.0-or-later
"""Oncue: a person who walks through the scene and sits or stops where the cues say, as an armature action."""

from __future__ import annotations

from types import ModuleType

from . import job_operator, manual, overlay, panels, preferences, properties, translations
from .operators import (
    edit,
    follow,
    go_to_frame,
    guide,
    library,
    manifold,
    menus,
    own_rig,
    place_cues,
    policies,
    scene_setup,
    synthesize,
    takes,
    ways,
)

#: In the order of registering: properties before what shows them, the job's handle before what uses it.
MODULES = (
    *(properties, preferences, job_operator),
    *(synthesize, follow, ways, library, manifold, place_cues, scene_setup, own_rig, edit, policies, go_to_frame),
    *(takes, guide, menus, panels, overlay, manual, translations),
)

_registered: list[ModuleType] = []


def register() -> None:
    """Registers everything; a second call starts afresh, and a failure leaves nothing behind."""
    if _registered:
        unregister()
    try:
        for module in MODULES:
            module.register()
            _registered.append(module)
    except Exception:
        unregister()
        raise


def unregister() -> None:
    """The reverse; what runs is cancelled and waited for first. A second call does nothing."""
    if job_operator in _registered:
        job_operator.handle.stop_and_wait("The run was stopped because Oncue was disabled.")
    while _registered:
        _registered.pop().unregister()
