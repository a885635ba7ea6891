# SPDX-License-Identifier: GPL-3.0-or-later
"""What the view shows, and whose it is: what a person wears, holds or carries is no furniture."""

from __future__ import annotations

import bpy
from mathutils import Vector

from .. import native
from .armature import find_character
from .names import CHARACTER_KEY, CUE_KEY, EXCLUDE_KEY, THING_KEY

#: Constraints that hang an object on their target, as a parent does.
HANGING = {"CHILD_OF", "ARMATURE", "COPY_TRANSFORMS", "COPY_LOCATION", "PIVOT"}
#: Modifiers that have an object carry a mesh along, as clothes hang on a body.
DEFORMING = {"ARMATURE", "HOOK", "MESH_DEFORM"}
#: Ways of showing an object by which nobody takes it for a solid thing.
OUTLINES = {"WIRE", "BOUNDS"}
#: A ray goes through so many surfaces that do not count, and is blocked by the next.
MOST_SURFACES = 256


def things_of(view_layer: bpy.types.ViewLayer) -> list[bpy.types.Object]:
    """The objects of a view layer; one that was deleted since the last update is none."""
    return [thing for thing in view_layer.objects if thing is not None]


def is_shown(thing: bpy.types.Object, view_layer: bpy.types.ViewLayer) -> bool:
    """Whether the view layer shows an object: its own eye and monitor, and those of the collections that it lies in.

    Local view and what else belongs to one view alone is a way of working, and hides nothing: batch has no view.
    """
    with bpy.context.temp_override(area=None):
        return thing.visible_get(view_layer=view_layer)


class Furniture:
    """Tells the scene's things from the character that is moved, its belongings, the cues and what was left out.

    Other persons, with what belongs to them, stand in the way as furniture does, but for the `cast`: the characters
    that are moved in the same run.
    """

    def __init__(
        self,
        context: bpy.types.Context,
        exclude: bpy.types.Collection | None = None,
        cast: tuple[bpy.types.Object, ...] = (),
    ) -> None:
        # Scripts read scenes without the extension: then nothing was chosen.
        settings = getattr(context.scene, "oncue", None)
        self._view_layer = context.view_layer
        exclude = exclude or (settings.exclude if settings else None)
        self._left_out = set(exclude.all_objects) if exclude else set()
        self._own = settings.character if settings else None
        if not native.MISSING:
            self._own = find_character(context.scene, native.core.skeleton()) or self._own
        self._moved = {self._own, *cast} - {None}
        #: What hands take is in nobody's way, and what they open the core has as it stands by then.
        self._taken = set(_taken(context.view_layer))
        self._shown: dict[bpy.types.Object, bool] = {}
        #: Object → the persons whose it is. What is being found out counts as nobody's, so that circles end.
        self._persons: dict[bpy.types.Object, frozenset[bpy.types.Object]] = {}

    def counts(self, owners: list[bpy.types.Object]) -> bool:
        """Whether a mesh is furniture: `owners` are its object and, of an instance, at last what instances it.

        A thing that only its instances show lies in no collection of the view: the instancing one is asked for.
        """
        if owners[-1] not in self._shown:
            self._shown[owners[-1]] = is_shown(owners[-1], self._view_layer)
        return self._shown[owners[-1]] and not any(map(self.is_left_out, owners))

    def is_of_person(self, thing: bpy.types.Object) -> bool:
        """Whether it is a character or hangs on one: by parents, an armature's deformation or a constraint."""
        return bool(self._persons_of(thing))

    def other_person(self, owners: list[bpy.types.Object]) -> str | None:
        """The name of the other person that a mesh, as `counts` has it, belongs to, or None."""
        names = {person.name for owner in owners for person in self._persons_of(owner) if person not in self._moved}
        return min(names, default=None)

    def is_left_out(self, thing: bpy.types.Object) -> bool:
        """Whether the character may walk through it: itself and its own, cues, outlines, what hands take or open,
        and what the artist says."""
        return (
            thing in self._left_out
            or thing in self._taken
            or thing.get(CUE_KEY) is not None
            or bool(thing.get(EXCLUDE_KEY))
            or thing.display_type in OUTLINES
            or self._is_own(thing)
        )

    def _is_own(self, thing: bpy.types.Object) -> bool:
        """Whether it is the character's, or of a skin or another mesh that carries the key without an armature."""
        persons = self._persons_of(thing)
        return not self._moved.isdisjoint(persons) or any(person.type != "ARMATURE" for person in persons)

    def _persons_of(self, thing: bpy.types.Object) -> frozenset[bpy.types.Object]:
        known = self._persons.get(thing)
        if known is None:
            self._persons[thing] = frozenset()
            keyed = thing.get(CHARACTER_KEY) is not None
            if thing in self._moved or (keyed and thing.type == "ARMATURE"):
                known = frozenset([thing])
            else:
                known = frozenset().union(*map(self._persons_of, carriers(thing)))
                if keyed and not known:
                    known = frozenset([thing])
            self._persons[thing] = known
        return known


def _taken(view_layer: bpy.types.ViewLayer) -> list[bpy.types.Object]:
    """What the visible Take and Open cues have taken and opened, with all that hangs on it."""
    kinds = ("take", "open")
    cues = [one for one in things_of(view_layer) if one.get(CUE_KEY) in kinds and is_shown(one, view_layer)]
    taken = [thing for cue in cues if isinstance(thing := cue.get(THING_KEY), bpy.types.Object)]
    return [one for thing in taken for one in [thing, *thing.children_recursive]]


def carriers(thing: bpy.types.Object) -> list[bpy.types.Object]:
    """What an object hangs on: its parent, what deforms it along with itself, and the targets of such constraints."""
    found = [thing.parent]
    found += [modifier.object for modifier in thing.modifiers if modifier.type in DEFORMING]
    found += [modifier.target for modifier in thing.modifiers if modifier.type == "SURFACE_DEFORM"]
    for constraint in thing.constraints:
        if constraint.type in HANGING and not constraint.mute and constraint.influence > 0.0:
            targets = constraint.targets if constraint.type == "ARMATURE" else [constraint]
            found += [target.target for target in targets]
    return [carrier for carrier in found if carrier is not None]


def furniture_on_ray(
    context: bpy.types.Context, furniture: Furniture, origin: Vector, direction: Vector, reach: float
) -> Vector | None:
    """Where a ray (scene units, `direction` of unit length) first meets furniture within `reach`, or None.

    It goes through everything that a run would not read.
    """
    depsgraph, place, left = context.evaluated_depsgraph_get(), Vector(origin), reach
    step = 1e-4 * max(reach, 1e-6)
    for _ in range(MOST_SURFACES):
        if left <= 0.0:
            return None
        hit, location, _, _, thing, _ = context.scene.ray_cast(depsgraph, place, direction, distance=left)
        if not hit:
            return None
        if not furniture.is_left_out(thing.original):
            return location
        left -= (location - place).length + step
        place = location + direction * step
    return None
