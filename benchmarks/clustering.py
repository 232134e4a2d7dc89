"""Two programs for one rule: HDBSCAN by `hdbscan` and by scikit-learn, on the outputs of runs.

    python -m benchmarks.clustering [largest number of runs, 100000]

The outputs v and w of two designs, standardised as the study's selection does it: the five-variable design,
one cloud, and the three actuations of [0, 30] % without gravity, of which a sixth collapses. `hdbscan` as the
study calls it looks for an approximate spanning tree; once more with an exact one, and scikit-learn, which
has an exact one only. Each clustering is in a process of its own. Printed are processor seconds, memory
beyond the process, groups, the size of the largest, the adjusted Rand index of the labels with the first
program's, and in how many runs "in the largest group", which is all that the selection asks, differs.
"""

import multiprocessing
import sys
import tempfile
import time
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from benchmarks.campaigns import five_variables, three_actuations
from benchmarks.solver.fresh import peak_bytes
from tensegra.study import Study

if TYPE_CHECKING:
    from queue import Queue

SIZES = (4_096, 16_384, 32_768, 100_000)
MIN_CLUSTER_SIZE = 40
DESIGNS = {"five variables": five_variables, "three actuations": three_actuations}


def outputs(study: Study) -> NDArray[np.float64]:
    """Return the standardised outputs of the runs that have some."""
    with tempfile.TemporaryDirectory() as folder:
        frame = study.run(folder).frame()
    Y = frame[["v", "w"]].to_numpy(dtype=float)
    Y = Y[np.isfinite(Y).all(axis=1)]
    return (Y - Y.mean(axis=0)) / Y.std(axis=0)


def by_hdbscan(Z: NDArray[np.float64]) -> NDArray[np.int64]:
    from hdbscan import HDBSCAN

    return HDBSCAN(min_cluster_size=MIN_CLUSTER_SIZE, core_dist_n_jobs=1).fit_predict(Z)


def by_sklearn(Z: NDArray[np.float64]) -> NDArray[np.int64]:
    from sklearn.cluster import HDBSCAN

    # hdbscan does not count a point among its own neighbours.
    return HDBSCAN(
        min_cluster_size=MIN_CLUSTER_SIZE, min_samples=MIN_CLUSTER_SIZE + 1, copy=True
    ).fit_predict(Z)


def by_hdbscan_exactly(Z: NDArray[np.float64]) -> NDArray[np.int64]:
    from hdbscan import HDBSCAN

    options = {"core_dist_n_jobs": 1, "approx_min_span_tree": False}
    return HDBSCAN(min_cluster_size=MIN_CLUSTER_SIZE, **options).fit_predict(Z)


PROGRAMS = {"hdbscan": by_hdbscan, "hdbscan, exact": by_hdbscan_exactly, "scikit-learn": by_sklearn}


def work(name: str, Z: NDArray[np.float64], found: "Queue[tuple[NDArray[np.int64], float, int]]") -> None:
    PROGRAMS[name](Z[:256])  # what is imported and compiled at the first call is not the clustering's
    before, began = peak_bytes(), time.process_time()
    labels = PROGRAMS[name](Z)
    found.put((labels, time.process_time() - began, peak_bytes() - before))


def apart(name: str, Z: NDArray[np.float64]) -> tuple[NDArray[np.int64], float, int]:
    """Cluster in a process of its own."""
    context = multiprocessing.get_context("spawn")
    found = context.Queue()
    process = context.Process(target=work, args=(name, Z, found))
    process.start()
    answer = found.get()
    process.join()
    return answer


def largest(labels: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return which runs are in the largest group."""
    groups, counts = np.unique(labels[labels >= 0], return_counts=True)
    return labels == groups[np.argmax(counts)] if len(groups) else np.zeros(len(labels), dtype=bool)


def main(most: int) -> None:
    from sklearn.metrics import adjusted_rand_score

    print("| design | runs | program | processor s | MiB | groups | largest | ARI | differ |")
    print("| --- | ---: | --- | ---: | ---: | ---: | ---: | ---: | ---: |")
    for design, study in DESIGNS.items():
        cloud = outputs(study())
        for n in (size for size in SIZES if size <= most):
            Z = cloud[:n]
            answers = {name: apart(name, Z) for name in PROGRAMS}
            reference = answers["hdbscan"][0]
            for name, (labels, seconds, memory) in answers.items():
                ari = adjusted_rand_score(reference, labels)
                differ = (largest(reference) != largest(labels)).sum()
                print(
                    f"| {design} | {len(Z):,} | {name} | {seconds:.2f} | {memory / 2**20:.0f} | "
                    f"{labels.max() + 1} | {largest(labels).sum():,} | {ari:.4f} | {differ:,} |",
                    flush=True,
                )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100_000)
