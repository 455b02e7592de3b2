#include "duet/nn/onnx_broadcast.h"

#include <fmt/format.h>

#include <algorithm>

namespace duet {

Shape broadcast_shape(const OnnxBuilder& builder, const Shape& a, const Shape& b) {
  Shape out(std::max(a.size(), b.size()), 1);
  for (std::size_t back = 1; back <= out.size(); ++back) {
    const std::int64_t size_a = back <= a.size() ? a[a.size() - back] : 1;
    const std::int64_t size_b = back <= b.size() ? b[b.size() - back] : 1;
    builder.require(size_a == size_b || size_a == 1 || size_b == 1,
                    fmt::format("shapes {} and {} do not fit together", shape_text(a), shape_text(b)));
    out[out.size() - back] = size_a == 1 ? size_b : size_a;
  }
  return out;
}

Shape strides_of(const Shape& shape) {
  Shape strides(shape.size(), 1);
  for (std::size_t d = shape.size(); d-- > 1;) strides[d - 1] = strides[d] * shape[d];
  return strides;
}

Shape broadcast_strides(const Shape& in, const Shape& out) {
  const Shape own = strides_of(in);
  Shape strides(out.size(), 0);
  for (std::size_t back = 1; back <= in.size(); ++back)
    if (in[in.size() - back] != 1) strides[out.size() - back] = own[in.size() - back];
  return strides;
}

}  // namespace duet
