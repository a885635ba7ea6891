# SPDX-License-Identifier: GPL-3.0-or-later
"""The only place that touches `bpy.data`: reads scene and cues into arrays, writes motion into an action."""
