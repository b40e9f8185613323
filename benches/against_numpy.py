"""Times the same three things as `streaming` and `imaging` in numpy and scipy, on the same links, and divides.

usage: benches/against_numpy.sh, which makes a Python environment in target/, runs the two benches and gives their lines to
this program; one thread each. What is timed, both times on 20 x 20 m with 2,000 or 4,000 links between places on its border:

- streaming: the most probable image under a stationary prior, kept as the Cholesky factor of the links' covariance
  S = W C W' + V (rti.md: MAP in link space); a link is bordered to it, and the image is C W' S^-1 y. C by FFT on twice
  the sides, W as sparse rows.
- cold: S of all links and its factor.
- tv: 20 steps of a primal-dual method for non-negative total variation with the same sparse rows.
"""
import os

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"
import re, sys, time
import numpy as np
import scipy.sparse as sp
from scipy.fft import irfft2, rfft2
from scipy.linalg import cholesky, solve_triangular

SIDE = 20.0
LAST = 12


def ends(count):
    """The links of the Rust benches."""
    def at(k, turn):
        share = (k * turn) % 1.0 * SIDE
        return [(share, 0.0), (SIDE, share), (share, SIDE), (0.0, share)][k % 4]
    return [(at(k, 0.618034), at(k + 1 + k // 4 % 3, 0.414214)) for k in range(count)]


def weights(count, n, half_m=0.3):
    """Rows that have weights within an ellipse of so much more way than the link, of the link's length in all."""
    side = SIDE / n
    centre = (np.arange(n) + 0.5) * side
    x, y = np.meshgrid(centre, centre)
    columns, values, starts = [], [], [0]
    for (x0, y0), (x1, y1) in ends(count):
        length = np.hypot(x1 - x0, y1 - y0)
        over = np.hypot(x - x0, y - y0) + np.hypot(x - x1, y - y1) - length
        inside = np.flatnonzero(over < half_m)
        way = np.maximum(over.ravel()[inside], side * 0.5) + length
        area = np.pi / 4 * way * np.sqrt(way**2 - length**2)
        weight = 1 / area
        columns.append(inside)
        values.append(weight * length / max(weight.sum(), 1e-12))
        starts.append(starts[-1] + len(inside))
    return sp.csr_matrix((np.concatenate(values), np.concatenate(columns), starts), shape=(count, n * n))


class Prior:
    def __init__(self, n, sigma2=0.3, delta=1.0):
        self.n, side = n, SIDE / n
        away = np.minimum(np.arange(2 * n), 2 * n - np.arange(2 * n)) * side
        self.of = rfft2(sigma2 * np.exp(-np.hypot(away[:, None], away[None, :]) / delta))

    def times(self, image):
        n = self.n
        wide = rfft2(image.reshape(n, n), (2 * n, 2 * n))
        return irfft2(wide * self.of, (2 * n, 2 * n))[:n, :n].ravel()


def gram(rows, prior):
    found = np.empty((rows.shape[0], rows.shape[0]))
    for k in range(rows.shape[0]):
        found[k] = rows @ prior.times(rows[k].toarray().ravel())
    return found


def stream(n, count):
    """Seconds of all but the last links together, median milliseconds of one more."""
    rows, prior = weights(count, n), Prior(n)
    y = np.array([k * 29 % 13 - 3.0 for k in range(count)])
    v = np.array([4.0 + k % 5 for k in range(count)])
    known = count - LAST
    began = time.perf_counter()
    square = gram(rows[:known], prior)
    factor = np.zeros((count, count), order="F")
    factor[:known, :known] = cholesky(square + np.diag(v[:known]), lower=True)
    cold = time.perf_counter() - began
    took = []
    for m in range(known, count):
        one, some, now = rows[m].toarray().ravel(), rows[:m], rows[: m + 1]
        began = time.perf_counter()
        spread = prior.times(one)
        border = solve_triangular(factor[:m, :m], some @ spread, lower=True, check_finite=False)
        factor[m, :m] = border
        factor[m, m] = np.sqrt(one @ spread + v[m] - border @ border)
        half = solve_triangular(factor[: m + 1, : m + 1], y[: m + 1], lower=True, check_finite=False)
        alpha = solve_triangular(factor[: m + 1, : m + 1], half, lower=True, trans=1, check_finite=False)
        prior.times(now.T @ alpha)
        took.append(time.perf_counter() - began)
    return cold, 1e3 * float(np.median(took))


def variation(n, count, steps=20):
    """Milliseconds of so many steps."""
    rows = weights(count, n)
    across = rows.T.tocsr()
    y = np.full(count, 5.0)
    x, bar, links = np.zeros(n * n), np.zeros(n * n), np.zeros(count)
    dual = np.zeros((2, n, n))
    norm = np.sqrt(abs(rows).sum(1).max() * abs(rows).sum(0).max() + 8.0)
    tau = sigma = 0.95 / norm
    began = time.perf_counter()
    for _ in range(steps):
        links = (links + sigma * (rows @ bar - y)) / (1 + sigma)
        image = bar.reshape(n, n)
        dual[0, :, :-1] += sigma * np.diff(image, axis=1)
        dual[1, :-1] += sigma * np.diff(image, axis=0)
        dual /= np.maximum(1.0, np.sqrt((dual**2).sum(0)) / 0.5)
        back = -np.diff(dual[0], axis=1, prepend=0.0) - np.diff(dual[1], axis=0, prepend=0.0)
        new = np.maximum(0.0, x - tau * (across @ links + back.ravel()))
        x, bar = new, 2 * new - x
    return 1e3 * (time.perf_counter() - began)


def main():
    ours = sys.stdin.read()
    found = re.findall(r"(\d+) x \d+ pixels, (\d+) links of \d+ weights: ([\d.]+) s together, then ([\d.]+) ms", ours)
    print("| what | numpy and scipy | tomoswarm | times as fast |\n| --- | --- | --- | --- |")
    for n, count, cold_s, link_ms in found:
        if int(count) > 4_000:
            continue
        cold, link = stream(int(n), int(count))
        print(f"| {n} x {n}, {count} links: one more link | {link:.1f} ms | {link_ms} ms | {link / float(link_ms):.0f} |", flush=True)
        print(f"| the same: all together | {cold:.1f} s | {cold_s} s | {cold / float(cold_s):.1f} |", flush=True)
    if steps := re.search(r"total variation, (\d+) x \d+ pixels, (\d+) links: .* ([\d.]+) ms for 20 steps", ours):
        took = variation(int(steps[1]), int(steps[2]))
        print(f"| 20 steps of total variation, {steps[1]} x {steps[1]}, {steps[2]} links | {took:.0f} ms | {steps[3]} ms | {took / float(steps[3]):.1f} |")


main()
