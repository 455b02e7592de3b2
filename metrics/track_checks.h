// Checks of the metrics' inputs. All throw std::invalid_argument naming metric and argument. Thread-safe.
#pragma once

#include <Eigen/Core>
#include <string>

#include "duet/core/recording.h"
#include "duet/metrics/readings.h"

namespace duet {

// At least one frame and one point, every value finite. `what` is "jpe: robot".
void require_finite(const PointTracks& tracks, const std::string& what);
// The shape of `other`, which is called `other_name`.
void require_same_shape(const PointTracks& tracks, const PointTracks& other, const std::string& what,
                        const std::string& other_name);
// (joints, T), neither empty, every value finite.
void require_finite(const Eigen::MatrixXd& values, const std::string& what);
void require_same_shape(const Eigen::MatrixXd& values, const Eigen::MatrixXd& other, const std::string& what,
                        const std::string& other_name);

// Derivatives of sampled signals by finite differences; a column is one sample. Shared by jerk metrics and diagnostics.

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
