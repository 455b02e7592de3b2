#include "duet/training/normaliser.h"

#include "duet/controllers/wbc_sim/network.h"

namespace duet {
namespace {

constexpr float kLeastDeviation = 1e-2F;

}  // namespace

void Normaliser::update(const Eigen::MatrixXf& x) {
  Normaliser batch(static_cast<int>(x.rows()));
  batch.mean = x.rowwise().mean();
  batch.variance = (x.colwise() - batch.mean).array().square().rowwise().mean();
  batch.count = static_cast<double>(x.cols());
  merge(batch);
}

void Normaliser::merge(const Normaliser& other) {
  const double total = count + other.count;
  if (total <= 0.0) return;
  const Eigen::VectorXf delta = other.mean - mean;
  const auto share = static_cast<float>(other.count / total), rest = static_cast<float>(count / total);
  mean += share * delta;
  variance = rest * variance + share * other.variance + rest * share * delta.cwiseAbs2();
  count = total;
}

Eigen::VectorXf Normaliser::deviation() const { return variance.cwiseSqrt().array() + kLeastDeviation; }

void Normaliser::set_deviation(const Eigen::VectorXf& deviation) {
  variance = (deviation.array() - kLeastDeviation).max(0.0F).square();
}

void Normaliser::apply(Eigen::MatrixXf& x) const {
  const Eigen::ArrayXf inverse = deviation().cwiseInverse();
  x.colwise() -= mean;
  x = (x.array().colwise() * inverse).cwiseMin(kNormalClip).cwiseMax(-kNormalClip).eval();
}

}  // namespace duet
