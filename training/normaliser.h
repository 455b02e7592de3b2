// Running mean and variance of a network's inputs. In float, as the network.
#pragma once

#include <Eigen/Core>

namespace duet {

inline constexpr double kLongestMemory = 4e6;  // samples: what the first poses looked like must not weigh for ever

struct Normaliser {
  Eigen::VectorXf mean, variance;
  double count = 1e-2;

  explicit Normaliser(int size = 0) : mean(Eigen::VectorXf::Zero(size)), variance(Eigen::VectorXf::Ones(size)) {}
  void update(const Eigen::MatrixXf& x);  // columns are samples
  void merge(const Normaliser& other);    // as if its samples had been given here
  // (x - mean) / deviation, clipped to +-kNormalClip, in place.
  void apply(Eigen::MatrixXf& x) const;
  [[nodiscard]] Eigen::VectorXf deviation() const;  // never below 1e-2
  void set_deviation(const Eigen::VectorXf& deviation);
};

}  // namespace duet
