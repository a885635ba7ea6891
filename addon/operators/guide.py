# SPDX-License-Identifier: GPL-3.0-or-later
"""The artist's guide, which comes with the extension and opens in the browser."""

from __future__ import annotations

import bpy
from bpy.props import StringProperty

from .. import manual
from .button import Button


class ONCUE_OT_open_guide(Button, bpy.types.Operator):
    """Open the guide at the page that tells of this, in the browser; it comes with Oncue and needs no network"""

    bl_idname = "oncue.open_guide"
    bl_label = "Guide"
    bl_options = {"INTERNAL"}

    page: StringProperty(name="Page", description="Which page of the guide", default=manual.INDEX)

    def act(self, _context: bpy.types.Context) -> None:
        bpy.ops.wm.url_open(url=manual.guide_page(self.page).as_uri())


register, unregister = bpy.utils.register_classes_factory((ONCUE_OT_open_guide,))
