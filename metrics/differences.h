// Derivatives of sampled signals by finite differences; a column is one sample. Shared by jerk metrics and diagnostics.
#pragma once

#include <Eigen/Core>

#include "duet/metrics/readings.h"

namespace duet {

// First derivative with as many samples: central differences inside, one-sided at both ends (numpy.gradient). Needs two
// samples.
Eigen::MatrixXd gradient(const Eigen::Ref<const Eigen::MatrixXd>& x, double rate_hz);

// Third derivative. kDiff: x[t+3] - 3 x[t+2] + 3 x[t+1] - x[t], T - 3 samples. kCentral:
// (x[t+2] - 2 x[t+1] + 2 x[t-1] - x[t-2]) / 2, T - 4 samples. kGradient: gradient() three times, T samples. Exact for a
// cubic with kDiff and kCentral (and with kGradient away from the ends). Needs min_samples(scheme).
Eigen::MatrixXd third_derivative(const Eigen::Ref<const Eigen::MatrixXd>& x, double rate_hz, JerkScheme scheme);
int min_samples(JerkScheme scheme);  // 4, 5, 4

// Throws std::invalid_argument naming `what`: a rate that is not positive, or too few samples for the scheme.
void require_sampling(Eigen::Index samples, double rate_hz, JerkScheme scheme, const char* what);

}  // namespace duet
