// The vectors of L-BFGS in lanes (kernel_types.h, VectorSweep). Included by the kernel files only, after kernel_body.h;
// everything has internal linkage.
#pragma once

namespace duet::pair_kernel {
namespace {

inline void filter_gradient(const VectorSweep& at, const Row* x, const Row* gradient, Row* out) {
  const Filter& f = *at.filter;
  for (int block = 0; block < at.blocks; ++block) {
    const std::size_t first = static_cast<std::size_t>(block) * at.rows;
    for (std::size_t i = 0; i < at.rows; ++i) {
      for (int lane = 0; lane < kLanes; lane += kWidth) {
        V g = load(gradient[first + i], lane);
        if (static_cast<int>(i) < at.setup->dof) {
          const V here = load(x[first + i], lane);
          const V zero = V{};
          const VI out_low = (here <= at.setup->lower[i]) & (g > zero);
          const VI out_high = (here >= at.setup->upper[i]) & (g < zero);
          g = (out_low | out_high) != 0 ? zero : g;
        }
        V y = g * f.inverse[i];
        if (block > 0) y -= f.first[i] * load(out[first - at.rows + i], lane);
        if (block > 1) y -= f.second[i] * load(out[first - 2 * at.rows + i], lane);
        store(out[first + i], lane, y);
      }
    }
  }
}

inline void step(const VectorSweep& at, const Row* x0, const Row* x1, const Row* g0, const Row* g1, Row* s, Row* y) {
  const Filter& f = *at.filter;
  for (int block = 0; block < at.blocks; ++block) {
    const std::size_t first = static_cast<std::size_t>(block) * at.rows;
    for (std::size_t i = 0; i < at.rows; ++i) {
      const std::size_t here = first + i, after = here + at.rows, second = after + at.rows;
      for (int lane = 0; lane < kLanes; lane += kWidth) {
        const V d0 = load(x1[here], lane) - load(x0[here], lane);
        const V d1 = load(x1[after], lane) - load(x0[after], lane);
        const V d2 = load(x1[second], lane) - load(x0[second], lane);
        store(s[here], lane, f.scale[i] * (d0 + f.first[i] * d1 + f.second[i] * d2));
        store(y[here], lane, load(g1[here], lane) - load(g0[here], lane));
      }
    }
  }
}

constexpr std::size_t kChunk = 32;  // rows of three vectors that stay in the first cache

// Products of two vectors at once: what is multiplied with them is loaded once, and six sums fit in registers.
inline void dots_of_two(const Row* const* two, const Row* s, const Row* y, const Row* g, std::size_t begin,
                        std::size_t end, Row* sums) {
  for (int lane = 0; lane < kLanes; lane += kWidth) {
    V sum[6];
    for (int k = 0; k < 6; ++k) sum[k] = load(sums[k], lane);
    for (std::size_t i = begin; i < end; ++i) {
      const V first = load(two[0][i], lane), second = load(two[1][i], lane);
      const V with_s = load(s[i], lane), with_y = load(y[i], lane), with_g = load(g[i], lane);
      sum[0] += first * with_s;
      sum[1] += first * with_y;
      sum[2] += first * with_g;
      sum[3] += second * with_s;
      sum[4] += second * with_y;
      sum[5] += second * with_g;
    }
    for (int k = 0; k < 6; ++k) store(sums[k], lane, sum[k]);
  }
}

inline void dots_of_gradient(const Row* s, const Row* y, const Row* g, std::size_t begin, std::size_t end, Row* sums) {
  for (int lane = 0; lane < kLanes; lane += kWidth) {
    V sum[3];
    for (int k = 0; k < 3; ++k) sum[k] = load(sums[k], lane);
    for (std::size_t i = begin; i < end; ++i) {
      const V here = load(g[i], lane);
      sum[0] += here * load(s[i], lane);
      sum[1] += here * load(y[i], lane);
      sum[2] += here * here;
    }
    for (int k = 0; k < 3; ++k) store(sums[k], lane, sum[k]);
  }
}

// `count` is even; `sums` are added to.
inline void dots(const VectorSweep& at, const Row* const* vectors, int count, int newest, const Row* g, Row* sums) {
  const std::size_t last = static_cast<std::size_t>(at.end) * at.rows;
  const Row *s = vectors[newest], *y = vectors[newest + 1];
  for (std::size_t begin = static_cast<std::size_t>(at.begin) * at.rows; begin < last; begin += kChunk) {
    const std::size_t end = begin + kChunk < last ? begin + kChunk : last;
    for (int k = 0; k < count; k += 2) dots_of_two(vectors + k, s, y, g, begin, end, sums + 3 * k);
    dots_of_gradient(s, y, g, begin, end, sums + 3 * count);
  }
}

inline void combine(const VectorSweep& at, const Row* const* vectors, const float* factors, int count, Row* out) {
  const Filter& f = *at.filter;
  for (int block = at.blocks - 1; block >= 0; --block) {
    const std::size_t first = static_cast<std::size_t>(block) * at.rows;
    for (std::size_t i = 0; i < at.rows; ++i) {
      for (int lane = 0; lane < kLanes; lane += kWidth) {
        V sum = V{};
        for (int k = 0; k < count; ++k) sum += factors[k] * load(vectors[k][first + i], lane);
        V d = sum * f.inverse[i];
        if (block + 1 < at.blocks) d -= f.first[i] * load(out[first + at.rows + i], lane);
        if (block + 2 < at.blocks) d -= f.second[i] * load(out[first + 2 * at.rows + i], lane);
        store(out[first + i], lane, d);
      }
    }
  }
}

inline void move(const VectorSweep& at, const Row* x, const Row* direction, float rate, float turn, Row* next) {
  for (int block = 0; block < at.blocks; ++block) {
    const std::size_t first = static_cast<std::size_t>(block) * at.rows;
    for (std::size_t i = 0; i < at.rows; ++i) {
      for (int lane = 0; lane < kLanes; lane += kWidth) {
        V d = rate * load(direction[first + i], lane);
        if (static_cast<int>(i) < at.setup->dof) {
          d = d < -turn ? V{} - turn : d;
          d = d > turn ? V{} + turn : d;
        }
        V v = load(x[first + i], lane) + d;
        if (static_cast<int>(i) < at.setup->dof) {
          v = v < at.setup->lower[i] ? V{} + at.setup->lower[i] : v;
          v = v > at.setup->upper[i] ? V{} + at.setup->upper[i] : v;
        }
        store(next[first + i], lane, v);
      }
    }
  }
}

// The functions that the kernel file exports, under the name of its instruction set.
constexpr LaneKernel kKernel = {.sweep = sweep_blocks,
                                .filter_gradient = filter_gradient,
                                .step = step,
                                .dots = dots,
                                .combine = combine,
                                .move = move};

}  // namespace
}  // namespace duet::pair_kernel
