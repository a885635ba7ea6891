"""The searches of benches/controller.rs by brute force (numpy) and by a k-d tree (scipy), a query at a time.

The least cost that each finds is compared with ours; of equal entries either may be named.
"""

from collections.abc import Callable

import numpy as np
import scipy
from scipy.spatial import KDTree
from work import Work, seconds, table

#: Brute force is given so many of the queries.
BRUTE = 200


def main() -> None:
    work = Work(__doc__)
    weights = work.floats("weights")
    features = np.ascontiguousarray(work.floats("features").reshape(-1, len(weights)) * weights)
    queries = np.ascontiguousarray(work.floats("queries").reshape(-1, len(weights)) * weights)
    costs, entries = work.floats("costs"), work.counts("entries")

    def brute(query: np.ndarray) -> int:
        difference = features - query
        return int(np.einsum("ij,ij->i", difference, difference).argmin())

    build = seconds(lambda: KDTree(features))
    tree = KDTree(features)

    def by_tree(query: np.ndarray) -> int:
        return int(tree.query(query)[1])

    def each(search: Callable[[np.ndarray], int], asked: np.ndarray) -> tuple[float, np.ndarray]:
        found = np.empty(len(asked), np.int64)

        def run() -> None:
            for k, query in enumerate(asked):
                found[k] = search(query)

        return seconds(run, 2) / len(asked) * 1e6, found

    notes = []
    brute_time, brute_found = each(brute, queries[:: max(1, len(queries) // BRUTE)])
    tree_time, tree_found = each(by_tree, queries)
    for name, found, which in (
        ("brute force", brute_found, slice(None, None, max(1, len(queries) // BRUTE))),
        ("the k-d tree", tree_found, slice(None)),
    ):
        exact = np.square(features[found].astype(np.float64) - queries[which].astype(np.float64)).sum(axis=1)
        worst = np.abs(exact - costs[which]).max() / costs[which].max()
        same = int((found == entries[which]).sum())
        notes.append(f"{name}: the same entry for {same} of {len(found)}, costs differ by {worst:.0e} of the largest")
        if worst > 1e-4:
            raise SystemExit(f"Not the same search: {notes[-1]}")
    table(
        f"{work.facts['title']}: {len(queries)} queries of {len(features)} x {len(weights)} numbers, one thread",
        "µs a query",
        [
            ("Oncue", work.facts["microseconds"]),
            (f"numpy {np.__version__}, brute force", brute_time),
            (f"scipy {scipy.__version__}, k-d tree (built in {build * 1e3:.0f} ms)", tree_time),
        ],
        notes,
    )


if __name__ == "__main__":
    main()
