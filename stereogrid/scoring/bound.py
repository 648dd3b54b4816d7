"""Is the error of the hits bounded as claimed? The share of them within 1.96 dl, nominal .95 (Eqs. 8 to 10, 13).

Two readings of "the error of a hit", both along the ray that is claimed for it:
  point    from the true point of the same pixel to the measured one. Just what the equations are about: a heading
           error moves a point across its ray, and so has no part in it.
  surface  from the first surface of the true mesh on the claimed ray to the measured point. What a user of the map
           meets: there a heading error and every edge count.
Hits of one observation share the error of its pose, and neighbours that of their match: n hits are far from n units.
"""

import numpy as np
from numpy.typing import ArrayLike

from ..camera import StereoCamera
from ..geometry import FloatArray
from ..observation import Disparity, Truth
from .calibration import covered, in_sigmas, stretch
from .casting import FAR_M, RayCaster
from .hits import Hits, Sampling, measure_hits
from .names import BOUND_NAMES, ERRORS_OF_HITS
from .ranking import ratio
from .score import Score


class BoundTest:
    """Gathers the hits of a drive, observation by observation, and gives the scores of BOUND_NAMES.

    surface: the true mesh, without which the scores of the surface are NaN. People and things that move are not in it.
    """

    def __init__(
        self, camera: StereoCamera, *, surface: RayCaster | None = None, sampling: Sampling | None = None
    ) -> None:
        self.camera, self.surface, self.sampling = camera, surface, sampling or Sampling()
        self._sigmas: dict[str, list[FloatArray]] = {kind: [] for kind in ERRORS_OF_HITS}
        self._n, self._mismatches = 0, 0

    def add(
        self,
        disparity: Disparity,
        T_world_cam: ArrayLike,
        truth: Truth,
        *,
        motion_sigma_m: float = 0.0,
        motion_rule: str = "rss",
        pose_covariance: ArrayLike | None = None,
    ) -> Hits:
        """Judge one observation, as in `measure_hits`, and return its hits."""
        hits = measure_hits(
            self.camera,
            disparity,
            T_world_cam,
            truth,
            sampling=self.sampling,
            motion_sigma_m=motion_sigma_m,
            motion_rule=motion_rule,
            pose_covariance=pose_covariance,
        )
        self._n += len(hits.range_m)
        self._mismatches += int(np.count_nonzero(hits.mismatch))
        self._keep("along", in_sigmas(hits.along_m, hits.along_sigma_m), hits)
        self._keep("across", in_sigmas(hits.across_m, hits.across_sigma_m), hits)
        if self.surface is not None:
            error_m, normal = surface_errors_m(hits, self.surface)
            self._keep("surface", in_sigmas(error_m, hits.along_sigma_m), hits)
            self._keep("slant", in_sigmas(error_m, hits.slant_sigma_m(normal)), hits)
        return hits

    def _keep(self, kind: str, sigmas: FloatArray, hits: Hits) -> None:
        self._sigmas[kind].append(sigmas)
        if f"{kind}_inliers" in self._sigmas:
            self._sigmas[f"{kind}_inliers"].append(sigmas[~hits.mismatch])

    def scores(self) -> list[Score]:
        """The scores of BOUND_NAMES, in its order; NaN with n = 0 where nothing was claimed or cast."""
        values = {"bound_mismatches": (ratio(self._mismatches, self._n), self._n)}
        for kind, parts in self._sigmas.items():
            sigmas = np.concatenate([np.empty(0), *parts])
            share, n = covered(sigmas)
            values |= {f"bound_coverage_{kind}": (share, n), f"bound_stretch_{kind}": (stretch(sigmas), n)}
        return [Score(name, values[name][0], unit, values[name][1]) for name, (unit, _) in BOUND_NAMES.items()]


def surface_errors_m(hits: Hits, surface: RayCaster) -> tuple[FloatArray, FloatArray]:
    """How far (N,) each hit lies behind the first surface on its claimed ray [m], and that surface's normal (N, 3).

    Where there is none: infinite, and against the ray.
    """
    first_m, normal = surface.hits(hits.origin_m, hits.ray)
    met = first_m < FAR_M
    error_m: FloatArray = np.where(met, hits.range_m - first_m, np.inf)
    return error_m, np.where(met[:, None], normal, -hits.ray)
