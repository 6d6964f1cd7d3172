"""GTSAM (PyPI `gtsam`, in an environment of its own) on the graph of smoother_bench: python3 gtsam_smoother.py X.g2o

Prints CPU time of Gauss-Newton (median of 5) and of iSAM2 with relinearizeSkip 10, one update per pose.
"""
import sys
import time

import gtsam
import numpy as np

path = sys.argv[1]
graph, start = gtsam.readG2o(path, True)
prior = gtsam.PriorFactorPose3(0, start.atPose3(0), gtsam.noiseModel.Isotropic.Sigma(6, 1e-4))

held = gtsam.NonlinearFactorGraph(graph)
held.add(prior)
parameters = gtsam.GaussNewtonParams()
parameters.setRelativeErrorTol(1e-6)
ms = []
for _ in range(5):
    optimizer = gtsam.GaussNewtonOptimizer(held, start, parameters)
    begin = time.process_time()
    result = optimizer.optimize()
    ms.append(1e3 * (time.process_time() - begin))
print(f"batch {path}: chi2 {2 * held.error(start):.6g} -> {2 * held.error(result):.6g} "
      f"in {optimizer.iterations()} iterations, median {np.median(ms):.0f} ms")

factors_at = {}
for k in range(graph.size()):
    factors_at.setdefault(max(graph.at(k).keys()), []).append(graph.at(k))
parameters = gtsam.ISAM2Params()
parameters.setRelinearizeThreshold(0.1)
parameters.relinearizeSkip = 10
isam = gtsam.ISAM2(parameters)
last, ms = start.atPose3(0), []
for key in range(start.size()):
    factors, values, guess = gtsam.NonlinearFactorGraph(), gtsam.Values(), last
    if key == 0:
        factors.add(prior)
    for factor in factors_at.get(key, []):
        factors.add(factor)
        if list(factor.keys()) == [key - 1, key]:
            guess = last.compose(factor.measured())
    values.insert(key, guess)
    begin = time.process_time()
    isam.update(factors, values)
    last = isam.calculateEstimatePose3(key)
    ms.append(1e3 * (time.process_time() - begin))
chi2 = 2 * graph.error(isam.calculateEstimate())
print(f"incremental {path}: {sum(ms) / 1e3:.2f} s, median {np.median(ms):.2f} ms, p99 {np.percentile(ms, 99):.1f}, "
      f"max {max(ms):.1f}, chi2 {chi2:.6g}")
