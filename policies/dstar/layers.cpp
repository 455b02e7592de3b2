#include "duet/policies/dstar/layers.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "duet/nn/dense_kernels.h"

namespace duet {
namespace {

constexpr float kEpsilon = 1e-5F;  // of the normalisations

struct Moments {
  float mean, inverse_deviation;
};

// The sum of `f` over `rows` numbers in each of `columns` columns that begin `step` apart. Four sums side by side: one
// after the other would wait for each addition.
template <typename F>
float sum(const float* x, int rows, int columns, int step, const F& f) {
  float sums[4] = {};
  for (int c = 0; c < columns; ++c) {
    const float* column = x + c * step;
    int i = 0;
    for (; i + 4 <= rows; i += 4)
      for (int k = 0; k < 4; ++k) sums[k] += f(column[i + k]);
    for (; i < rows; ++i) sums[0] += f(column[i]);
  }
  return (sums[0] + sums[1]) + (sums[2] + sums[3]);
}

Moments moments(const float* x, int rows, int columns, int step) {
  const auto count = static_cast<float>(rows * columns);
  const float mean = sum(x, rows, columns, step, [](float value) { return value; }) / count;
  const float square = sum(x, rows, columns, step, [mean](float value) { return (value - mean) * (value - mean); });
  return {mean, 1.0F / std::sqrt(square / count + kEpsilon)};
}

float dot(const float* a, const float* b, int n) {
  float result = 0.0F;
  for (int i = 0; i < n; ++i) result += a[i] * b[i];
  return result;
}

}  // namespace

void Linear::apply(const float* x, int step, float* y, int columns) const {
  // A few rows for all columns, then the next ones: they stay in the nearest cache.
  constexpr int kRows = 8;
  const int at_once = columns == 1 ? outputs : kRows;
  const auto gemv = dense_kernels().gemv;
  for (int row = 0; row < outputs; row += at_once)
    for (int c = 0; c < columns; ++c)
      gemv(std::min(at_once, outputs - row), inputs, weight + static_cast<std::ptrdiff_t>(row) * inputs, x + c * step,
           bias == nullptr ? nullptr : bias + row, y + c * outputs + row);
}

void Norm::by_column(const float* x, float* y, int columns) const {
  for (int c = 0; c < columns; ++c, x += channels, y += channels) {
    const Moments m = moments(x, channels, 1, channels);
    for (int i = 0; i < channels; ++i) y[i] = (x[i] - m.mean) * m.inverse_deviation * weight[i] + bias[i];
  }
}

void Norm::by_group(const float* x, float* y, int groups, int columns) const {
  const int size = channels / groups;
  for (int first = 0; first < channels; first += size) {
    const Moments m = moments(x + first, size, columns, channels);
    for (int c = 0; c < columns; ++c)
      for (int i = first; i < first + size; ++i)
        y[c * channels + i] = (x[c * channels + i] - m.mean) * m.inverse_deviation * weight[i] + bias[i];
  }
}

void silu(std::span<float> x) {
  for (float& value : x) value /= 1.0F + std::exp(-value);
}

void gelu(std::span<float> x) {
  constexpr auto kScale = static_cast<float>(1.0 / std::numbers::sqrt2);
  for (float& value : x) value *= 0.5F * (1.0F + std::erf(value * kScale));
}

void softmax(std::span<float> x) {
  const float largest = *std::ranges::max_element(x);
  float total = 0.0F;
  for (float& value : x) total += value = std::exp(value - largest);
  for (float& value : x) value /= total;
}

void add(std::span<float> x, const float* y) {
  for (std::size_t i = 0; i < x.size(); ++i) x[i] += y[i];
}

void clip(std::span<float> x, float bound) {
  for (float& value : x) value = value > bound ? bound : (value < -bound ? -bound : value);
}

void attend(const Attention& a, std::span<float> scores) {
  const float scale = 1.0F / std::sqrt(static_cast<float>(a.size));
  for (int i = 0; i < a.tokens; ++i) {
    for (int j = 0; j < a.tokens; ++j) scores[j] = scale * dot(a.q + i * a.step, a.k + j * a.step, a.size);
    softmax(scores.first(a.tokens));
    float* out = a.out + i * a.out_step;
    std::fill_n(out, a.size, 0.0F);
    for (int j = 0; j < a.tokens; ++j)
      for (int d = 0; d < a.size; ++d) out[d] += scores[j] * a.v[j * a.step + d];
  }
}

void attend_by_heads(const float* qkv, int tokens, int width, int heads, float* out, std::span<float> scores) {
  const int size = width / heads;
  for (int first = 0; first < width; first += size)
    attend({.q = qkv + first,
            .k = qkv + width + first,
            .v = qkv + 2 * width + first,
            .step = 3 * width,
            .tokens = tokens,
            .size = size,
            .out = out + first,
            .out_step = width},
           scores);
}

Linear WeightsOf::linear(const std::string& name) const {
  const Tensor& weight = weights_.at(name + ".weight");
  const auto bias = weights_.find(name + ".bias");
  return {.outputs = static_cast<int>(weight.shape[0]),
          .inputs = static_cast<int>(weight.shape[1]),
          .weight = weight.values.data(),
          .bias = bias == weights_.end() ? nullptr : bias->second.values.data()};
}

Norm WeightsOf::norm(const std::string& name) const {
  const Tensor& weight = weights_.at(name + ".weight");
  return {
      .channels = static_cast<int>(weight.shape[0]), .weight = weight.values.data(), .bias = values(name + ".bias")};
}

}  // namespace duet
