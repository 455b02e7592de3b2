// The smoothing at the end of PAIR (supplement A.1.2): Gaussian, kernel 5, sigma 0.75, over time.
#pragma once

#include <Eigen/Core>

namespace duet {

// Each row of `x` (joints, T) is filtered along its columns; beyond the ends the first and last columns repeat. The
// weights are positive and sum to one, so that bounds on x hold for the result up to rounding.
Eigen::MatrixXd gaussian_filter(const Eigen::MatrixXd& x);

}  // namespace duet
