// D-STAR's arithmetic in double precision, without a thought for speed (docs/file-formats.md, "Arithmetic").
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "tests/policies/dstar_fixtures.h"

namespace duet::test {
namespace {

using Matrix = Eigen::MatrixXd;  // columns are frames, tokens or positions
using Vector = Eigen::VectorXd;

double silu_of(double x) { return x / (1.0 + std::exp(-x)); }
double gelu_of(double x) { return 0.5 * x * (1.0 + std::erf(x / std::sqrt(2.0))); }
Matrix silu_of(const Matrix& x) {
  return x.unaryExpr([](double value) { return silu_of(value); });
}
Vector concat(const Vector& a, const Vector& b) {
  Vector both(a.size() + b.size());
  both << a, b;
  return both;
}

// Columns of q, k and v are tokens.
Matrix attention(const Matrix& q, const Matrix& k, const Matrix& v) {
  Matrix weights = (k.transpose() * q / std::sqrt(static_cast<double>(q.rows()))).array().exp();
  for (auto column : weights.colwise()) column /= column.sum();
  return v * weights;
}

class Plain {
 public:
  Plain(const DstarNetwork& network, const DstarSample& sample) : network_(network), sample_(sample) {}

  DstarExpected run() {
    const Vector g = condition();
    Vector x = Eigen::Map<const Eigen::VectorXf>(sample_.noise.data(), kPlanSize).cast<double>(), x0;
    const std::vector<double> alpha_bar = squared_cosine_alpha_bar(config_.training_steps);
    const std::vector<int> steps = ddim_steps(config_.training_steps, config_.inference_steps);
    for (std::size_t i = 0; i < steps.size(); ++i) {
      const double now = alpha_bar[steps[i]], next = i + 1 < steps.size() ? alpha_bar[steps[i + 1]] : 1.0;
      x0 = denoise(x.reshaped(kAnchorSize, kAnchors), steps[i], g).reshaped().cwiseMax(-5.0).cwiseMin(5.0);
      const Vector noise = (x - std::sqrt(now) * x0) / std::sqrt(1.0 - now);
      x = std::sqrt(next) * x0 + std::sqrt(1.0 - next) * noise;
    }
    const Vector plan =
        network_.plan_mean.cast<double>() + Vector(network_.plan_deviation.cast<double>().cwiseProduct(x0));
    return {phases_, x0, plan};
  }

 private:
  [[nodiscard]] Matrix matrix(const std::string& name) const {
    const Tensor& tensor = network_.weights.at(name);
    const std::int64_t columns = tensor.shape.size() > 1 ? tensor.shape[1] : 1;
    Matrix result(tensor.shape[0], columns);
    for (std::int64_t i = 0; i < tensor.shape[0]; ++i)
      for (std::int64_t j = 0; j < columns; ++j) result(i, j) = tensor.values[i * columns + j];
    return result;
  }
  [[nodiscard]] Matrix linear(const std::string& name, const Matrix& x) const {
    return (matrix(name + ".weight") * x).colwise() + Vector(matrix(name + ".bias"));
  }
  [[nodiscard]] Matrix scale(const std::string& name, const Matrix& x) const {
    return (x.array().colwise() * matrix(name + ".weight").col(0).array()).colwise() +
           matrix(name + ".bias").col(0).array();
  }
  [[nodiscard]] Matrix layer_norm(const std::string& name, Matrix x) const {
    for (auto column : x.colwise()) column = normalised(column);
    return scale(name, x);
  }
  [[nodiscard]] Matrix group_norm(const std::string& name, Matrix x) const {
    const Eigen::Index size = x.rows() / config_.groups;
    for (Eigen::Index first = 0; first < x.rows(); first += size)
      x.middleRows(first, size) = normalised(x.middleRows(first, size));
    return scale(name, x);
  }
  static Matrix normalised(const Matrix& x) {
    const Matrix centred = x.array() - x.mean();
    return centred / std::sqrt(centred.array().square().mean() + 1e-5);
  }
  // Attention of tokens given as q, k, v by heads.
  static Matrix by_heads(const Matrix& qkv, int heads) {
    const Eigen::Index width = qkv.rows() / 3, size = width / heads;
    Matrix out(width, qkv.cols());
    for (Eigen::Index at = 0; at < width; at += size)
      out.middleRows(at, size) =
          attention(qkv.middleRows(at, size), qkv.middleRows(width + at, size), qkv.middleRows(2 * width + at, size));
    return out;
  }

  [[nodiscard]] Vector stream(const std::string& name, const DstarFrames& seen, int frames) const {
    Matrix x = seen.cast<double>().rightCols(frames);
    x = ((x.colwise() - network_.frame_mean.cast<double>()).array().colwise() /
         network_.frame_deviation.cast<double>().array())
            .cwiseMax(-10.0)
            .cwiseMin(10.0)
            .matrix();
    x = linear(name + ".in", x) + matrix(name + ".position").transpose();
    for (int l = 0; l < config_.layers; ++l) {
      const std::string layer = fmt::format("{}.{}", name, l);
      x += linear(layer + ".out", by_heads(linear(layer + ".qkv", layer_norm(layer + ".norm1", x)), config_.heads));
      const Matrix up = linear(layer + ".up", layer_norm(layer + ".norm2", x));
      x += linear(layer + ".down", up.unaryExpr([](double value) { return gelu_of(value); }));
    }
    return linear(name + ".head", layer_norm(name + ".norm", x.rightCols(1)));
  }

  [[nodiscard]] Vector phase(const Vector& f_temp) {
    phases_ = linear("phase.classify2", silu_of(linear("phase.classify1", f_temp))).array().exp();
    phases_ /= phases_.sum();
    Vector mixture = Vector::Zero(f_temp.size());
    const Eigen::Index temporal = f_temp.size(), size = temporal / config_.tokens;
    for (int i = 0; i < kPhases; ++i) {
      const Vector qkv = linear(fmt::format("phase.expert.{}", i), f_temp);
      const auto tokens = [&](int part) -> Matrix {
        return qkv.segment(part * temporal, temporal).reshaped(size, config_.tokens);
      };
      mixture += phases_[i] * attention(tokens(0), tokens(1), tokens(2)).reshaped();
    }
    return linear("phase.out", mixture);
  }

  [[nodiscard]] Vector spatial(const Vector& f_temp) const {
    Vector all = sample_.features.position.cast<double>();
    for (const float distance : sample_.features.distance) {
      const std::string zone = fmt::format("spatial.zone.{}.", distance < 0.3F ? 0 : (distance < 0.8F ? 1 : 2));
      const Vector input = Vector::Constant(1, distance);
      all = concat(all, linear(zone + "2", silu_of(linear(zone + "1", input))));
    }
    all = concat(all, silu_of(linear("spatial.orientation", sample_.features.orientation.cast<double>())));
    Matrix x(config_.field, 2);
    x << linear("spatial.field2", silu_of(linear("spatial.field1", all))), linear("spatial.temporal", f_temp);
    x += linear("spatial.fusion.out", by_heads(linear("spatial.fusion.qkv", x), config_.fusion_heads));
    return linear("spatial.out", x.reshaped());
  }

  Vector condition() {
    Vector streams = stream("long", sample_.features.past, config_.long_frames);
    if (config_.short_stream) streams = concat(streams, stream("short", sample_.features.frames, config_.short_frames));
    const Vector f_temp = linear("temporal", streams);
    Vector c = f_temp;
    if (config_.phase_attention) c = concat(c, phase(f_temp));
    if (config_.spatial_reasoning) c = concat(c, spatial(f_temp));
    if (config_.language_on)
      c = concat(c, Eigen::Map<const Eigen::VectorXf>(sample_.language.data(), config_.language).cast<double>());
    return linear("condition.2", silu_of(linear("condition.1", c)));
  }

  [[nodiscard]] Matrix convolution(const std::string& name, const Matrix& x) const {
    const std::vector<float>& weight = network_.weights.at(name + ".weight").values;
    Matrix y = matrix(name + ".bias").replicate(1, x.cols());
    for (Eigen::Index p = 0; p < x.cols(); ++p)
      for (Eigen::Index tap = 0; tap < 3; ++tap)
        for (Eigen::Index in = 0; in < x.rows() && p + tap >= 1 && p + tap <= x.cols(); ++in)
          for (Eigen::Index out = 0; out < x.rows(); ++out)
            y(out, p) += weight[(out * x.rows() + in) * 3 + tap] * x(in, p + tap - 1);
    return y;
  }

  [[nodiscard]] Matrix denoise(const Matrix& x, int t, const Vector& g) const {
    const int half = config_.step_embedding / 2;
    Vector embedding(2 * half);
    for (int i = 0; i < half; ++i) {
      embedding[i] = std::sin(t * std::pow(10000.0, -static_cast<double>(i) / half));
      embedding[half + i] = std::cos(t * std::pow(10000.0, -static_cast<double>(i) / half));
    }
    const Vector e = linear("step.2", silu_of(linear("step.1", embedding)));
    Matrix h = linear("denoise.in", x) + matrix("denoise.position").transpose();
    for (int b = 0; b < config_.blocks; ++b) {
      const std::string block = fmt::format("denoise.{}", b);
      Matrix y = convolution(block + ".conv1", silu_of(group_norm(block + ".norm1", h)));
      const Vector film = linear(block + ".film_condition", g) + matrix(block + ".film_step.weight") * e;
      y = (group_norm(block + ".norm2", y).array().colwise() * (1.0 + film.head(config_.channels).array())).colwise() +
          film.tail(config_.channels).array();
      h += convolution(block + ".conv2", silu_of(y));
    }
    return linear("denoise.out", silu_of(group_norm("denoise.norm", h)));
  }

  const DstarNetwork& network_;
  const DstarSample& sample_;
  const DstarConfig& config_ = network_.config;
  Vector phases_;
};

}  // namespace

DstarSample random_sample(const DstarConfig& config, std::uint64_t seed) {
  Random random(seed, 7);
  DstarSample sample;
  const auto fill = [&random](auto&& values) {
    for (float& value : values) value = static_cast<float>(random.normal());
  };
  fill(sample.features.frames.reshaped());
  fill(sample.features.past.reshaped());
  fill(sample.features.position);
  fill(sample.features.orientation);
  sample.features.distance << 0.05F, 0.29F, 0.3F, 0.79F, 0.8F, 2.5F;
  sample.features.frames.col(kHistoryFrames - 2) *= 20.0F;
  sample.language.resize(static_cast<std::size_t>(config.language));
  sample.noise.resize(kPlanSize);
  fill(sample.language);
  fill(sample.noise);
  return sample;
}

DstarExpected evaluate_plainly(const DstarNetwork& network, const DstarSample& sample) {
  return Plain(network, sample).run();
}

}  // namespace duet::test
