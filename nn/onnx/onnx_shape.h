// Broadcasting as ONNX (and NumPy) define it: shapes are aligned at their ends, and a size 1 stretches. Pure functions.
// Internal to nn/.
#pragma once

#include <array>
#include <vector>

#include "duet/nn/onnx/onnx_plan.h"

namespace duet {

// Refused by the builder where the shapes do not fit.
Shape broadcast_shape(const OnnxBuilder& builder, const Shape& a, const Shape& b);

// Distance in memory of neighbours along each dimension of `out` in a tensor of shape `in`; 0 where it is stretched.
Shape broadcast_strides(const Shape& in, const Shape& out);
// The same of a tensor that is not stretched.
Shape strides_of(const Shape& shape);

// A loop over the elements of a shape: runs of `inner` elements, each a fixed step apart in every operand, from the
// places `from[run][operand]`; dimensions are merged as far as they can be.
template <int N>
struct BroadcastLoop {
  std::int64_t inner = 1;
  std::array<std::int64_t, N> step{};  // 0 or 1 by construction of the innermost run, or a stride
  std::vector<std::array<std::int64_t, N>> from;
};

template <int N>
BroadcastLoop<N> broadcast_loop(const std::array<Shape, N>& in, const Shape& out) {
  std::array<Shape, N> strides;
  for (int n = 0; n < N; ++n) strides[n] = broadcast_strides(in[n], out);
  BroadcastLoop<N> loop;
  int dim = static_cast<int>(out.size()) - 1;
  // A dimension joins the inner run where every operand walks on at the run's end as it walks within.
  for (bool started = false; dim >= 0; --dim) {
    if (out[dim] == 1) continue;
    bool joins = true;
    for (int n = 0; n < N; ++n) joins = joins && (!started || strides[n][dim] == loop.step[n] * loop.inner);
    if (!joins) break;
    if (!started)
      for (int n = 0; n < N; ++n) loop.step[n] = strides[n][dim];
    started = true;
    loop.inner *= out[dim];
  }
  loop.from.emplace_back();
  for (int d = 0; d <= dim; ++d) {
    std::vector<std::array<std::int64_t, N>> next;
    for (const auto& from : loop.from)
      for (std::int64_t k = 0; k < out[d]; ++k) {
        next.push_back(from);
        for (int n = 0; n < N; ++n) next.back()[n] += k * strides[n][d];
      }
    loop.from = std::move(next);
  }
  return loop;
}

}  // namespace duet
