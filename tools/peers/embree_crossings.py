"""The box edges of benches/scene.rs as rays through Embree, on one thread.

Embree has no count of crossings. Two things are measured: whether an edge hits anything at all (less work than ours),
and all of its hits by casting again from behind the last one until there is none, which is what r_coli needs. So Embree
sees one surface where two coincide, as where a table's leg meets its top: it is compared with the crossings that the
bench found without such. Edges were cut off under the height from which crossings count, so that a hit is a crossing.
"""

import numpy as np
from embreex import __version__, rtcore_scene
from embreex.mesh_construction import TriangleMesh
from work import Work, seconds, table

#: Crossings that two rows of roundings may count differently: where an edge passes between two triangles, or its end
#: or the height from which crossings count lies within a rounding of one.
TOLERANCE = 0.001


def main() -> None:
    work = Work(__doc__)
    positions = work.floats("positions").reshape(-1, 3)
    triangles = work.counts("triangles").reshape(-1, 3).astype(np.int32)
    behind = np.float32(work.facts["behind"])
    scene = None

    def build() -> None:
        nonlocal scene
        scene = rtcore_scene.EmbreeScene()
        TriangleMesh(scene, positions, triangles)
        # Embree builds its tree at the first ray.
        scene.run(np.zeros((1, 3), np.float32), np.float32([[0, 0, 1]]))

    title = work.facts["title"]
    built = seconds(build, 2)
    table(
        f"{title}: build",
        "s",
        [
            ("Oncue (tree, distance field, occupancy)", work.facts["build_seconds"]),
            (f"Embree {__version__} (tree)", built),
        ],
        [],
    )

    for kind, ours in work.facts["kinds"].items():
        numbers = work.floats(f"{kind}-edges").reshape(-1, 7)
        edges = numbers[numbers[:, 6] > 0]
        frames = ours["frames"]
        origins, directions, lengths = (np.ascontiguousarray(edges[:, part]) for part in (slice(3), slice(3, 6), 6))

        # embreex writes the distances of hits into the lengths that it is given, so it is given copies.
        def any_hit(origins=origins, directions=directions, lengths=lengths) -> np.ndarray:
            return scene.run(origins, directions, lengths.copy(), query="OCCLUDED")

        def count(origins=origins, directions=directions, lengths=lengths) -> int:
            total = 0
            while len(origins):
                hits = scene.run(origins, directions, lengths.copy(), query="INTERSECT", output=True)
                hit = hits["primID"] >= 0
                total += int(hit.sum())
                gone = hits["tfar"][hit] + behind
                origins = origins[hit] + gone[:, None] * directions[hit]
                directions, lengths = directions[hit], lengths[hit] - gone
                left = lengths > 0
                origins, directions, lengths = origins[left], directions[left], lengths[left]
            return total

        found = count()
        asked, counted = seconds(any_hit, 3), seconds(count, 3)
        table(
            f"{title}, {kind}: {frames} frames of 8 limbs, 12 edges each, one thread",
            "µs a frame",
            [
                ("Oncue, all crossings", ours["microseconds"]),
                ("Embree, all crossings by casting again", counted / frames * 1e6),
                ("Embree, whether any", asked / frames * 1e6),
            ],
            [
                f"crossings a frame: ours {ours['crossings'] / frames:.3f}, "
                f"without coinciding ones {ours['apart'] / frames:.3f}, Embree {found / frames:.3f}"
            ],
        )
        if abs(found - ours["apart"]) > TOLERANCE * max(found, ours["apart"]) + 10:
            raise SystemExit(f"Embree counts {found} crossings, we {ours['apart']}.")


if __name__ == "__main__":
    main()
