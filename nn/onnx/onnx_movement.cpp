// Operators that move numbers: slices, joins, orders. Whatever a node does to the order of its input is
// worked out at load; what is left at run time is a list of copies, or nothing.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "duet/nn/onnx/onnx_plan.h"
#include "duet/nn/onnx/onnx_shape.h"

namespace duet {
namespace {

// `count` numbers, `step` apart in the source, to consecutive places.
struct Copy {
  std::int64_t from = 0, step = 1, count = 1;
};

// For each dimension of the output: where in the source each of its indices leads. The places of an element add up.
using Places = std::vector<std::vector<std::int64_t>>;

std::vector<std::int64_t> origins(const Places& places) {
  std::vector<std::int64_t> origins = {0};
  for (const auto& along : places) {
    std::vector<std::int64_t> next;
    next.reserve(origins.size() * along.size());
    for (const std::int64_t origin : origins)
      for (const std::int64_t place : along) next.push_back(origin + place);
    origins = std::move(next);
  }
  return origins;
}

std::vector<Copy> merged(const std::vector<std::int64_t>& origins) {
  std::vector<Copy> copies;
  for (const std::int64_t origin : origins) {
    if (!copies.empty()) {
      Copy& last = copies.back();
      const std::int64_t step = origin - (last.from + (last.count - 1) * last.step);
      if (last.count == 1 || step == last.step) {
        last.step = step;
        ++last.count;
        continue;
      }
    }
    copies.push_back({.from = origin});
  }
  return copies;
}

template <typename T>
void run(const std::vector<Copy>& copies, const T* from, T* to) {
  for (const Copy& copy : copies) {
    const T* at = from + copy.from;
    if (copy.step == 1)
      to = std::copy(at, at + copy.count, to);
    else
      for (std::int64_t k = 0; k < copy.count; ++k) *to++ = at[k * copy.step];
  }
}

// Output `i` holds, in order, what `places` point at in `source`.
void move(OnnxBuilder& builder, int i, const OnnxValue& source, const Shape& shape, const Places& places) {
  builder.require(count_of(shape) <= kMostOrdered, fmt::format("gives too many numbers: {}", shape_text(shape)));
  const std::vector<Copy> copies = merged(origins(places));
  if (source.whole_constant()) {
    std::vector<std::int64_t> values(static_cast<std::size_t>(count_of(shape)));
    run(copies, source.integers.data(), values.data());
    return builder.whole_output(i, shape, std::move(values), source.type);
  }
  if (copies.size() <= 1 && (copies.empty() || copies[0].step == 1 || copies[0].count == 1))
    return builder.alias(i, source, shape, copies.empty() ? 0 : copies[0].from);
  float* to = builder.output(i, shape, source.type);
  builder.step([copies, from = source.data, to] { run(copies, from, to); });
}

// Places that leave a tensor as it is.
Places identity_places(const Shape& shape) {
  const Shape strides = strides_of(shape);
  Places places(shape.size());
  for (std::size_t d = 0; d < shape.size(); ++d)
    for (std::int64_t k = 0; k < shape[d]; ++k) places[d].push_back(k * strides[d]);
  return places;
}

void check_moved(const OnnxBuilder& builder, const Shape& shape) {
  for (const std::int64_t size : shape)
    builder.require(size <= kMostOrdered, fmt::format("is given too many numbers: {}", shape_text(shape)));
}

void transpose(OnnxBuilder& builder) {
  const OnnxValue& source = builder.input(0);
  std::vector<std::int64_t> reversed(source.shape.size());
  std::iota(reversed.rbegin(), reversed.rend(), 0);
  const std::vector<std::int64_t> order = builder.integers("perm").value_or(reversed);
  builder.require(order.size() == source.shape.size(),
                  fmt::format("perm: expected {} axes, found {}", source.rank(), order.size()));
  (void)marked_axes(builder, order, source.rank());
  check_moved(builder, source.shape);
  const Places from = identity_places(source.shape);
  Places places;
  Shape shape;
  for (const std::int64_t axis : order) {
    places.push_back(from[builder.axis(axis, source.rank())]);
    shape.push_back(source.shape[builder.axis(axis, source.rank())]);
  }
  move(builder, 0, source, shape, places);
}

// The indices that start:end:step takes of `size`, clamped as ONNX says.
std::vector<std::int64_t> slice_indices(std::int64_t start, std::int64_t end, std::int64_t step, std::int64_t size) {
  const auto clamped = [&](std::int64_t at, std::int64_t least, std::int64_t most) {
    return std::clamp(at < 0 ? std::max(at, -size - 1) + size : at, least, most);
  };
  std::vector<std::int64_t> indices;
  if (step > 0) {
    const std::int64_t last = clamped(end, 0, size);
    for (std::int64_t k = clamped(start, 0, size); k < last; k += step) {
      indices.push_back(k);
      if (step >= size) break;
    }
  } else {
    const std::int64_t last = clamped(end, -1, size - 1);
    for (std::int64_t k = clamped(start, -1, size - 1); k > last; k += step) {
      indices.push_back(k);
      if (step <= -size) break;
    }
  }
  return indices;
}

void slice(OnnxBuilder& builder) {
  const OnnxValue& source = builder.input(0);
  const std::vector<std::int64_t>&starts = builder.whole_numbers(1), &ends = builder.whole_numbers(2);
  std::vector<std::int64_t> axes(starts.size());
  std::iota(axes.begin(), axes.end(), 0);
  if (builder.has_input(3)) axes = builder.whole_numbers(3);
  std::vector<std::int64_t> steps(starts.size(), 1);
  if (builder.has_input(4)) steps = builder.whole_numbers(4);
  builder.require(ends.size() == starts.size() && axes.size() == starts.size() && steps.size() == starts.size(),
                  "expected as many starts as ends, axes and steps");
  (void)marked_axes(builder, axes, source.rank());
  check_moved(builder, source.shape);
  Places places = identity_places(source.shape);
  Shape shape = source.shape;
  const Shape strides = strides_of(source.shape);
  for (std::size_t k = 0; k < axes.size(); ++k) {
    const int axis = builder.axis(axes[k], source.rank());
    builder.require(steps[k] != 0, "expected steps that are not 0");
    places[axis] = slice_indices(starts[k], ends[k], steps[k], source.shape[axis]);
    shape[axis] = static_cast<std::int64_t>(places[axis].size());
    for (std::int64_t& place : places[axis]) place *= strides[axis];
  }
  move(builder, 0, source, shape, places);
}

// From operator set 18 without sizes: as many parts as the attribute says, the last smaller where it has to be.
std::vector<std::int64_t> counted_parts(const OnnxBuilder& builder, std::int64_t size) {
  const std::int64_t parts = builder.integer("num_outputs", 0), outputs = builder.output_count();
  builder.require(parts == outputs, fmt::format("num_outputs: expected {}, found {}", outputs, parts));
  const std::int64_t whole = (size + parts - 1) / parts, last = size - (parts - 1) * whole;
  builder.require(last >= 0, fmt::format("{} numbers are not {} parts", size, parts));
  std::vector<std::int64_t> sizes(static_cast<std::size_t>(parts), whole);
  sizes.back() = last;
  return sizes;
}

// Sizes of the parts: an attribute up to operator set 12, an input from 13, equal parts where neither is given.
std::vector<std::int64_t> part_sizes(const OnnxBuilder& builder, std::int64_t size) {
  builder.require(builder.opset() < 18 || builder.has_input(1) != (builder.attribute("num_outputs") != nullptr),
                  "expected sizes as an input or num_outputs, one of the two, from operator set 18");
  if (builder.opset() >= 13 && builder.has_input(1)) return builder.whole_numbers(1);
  if (builder.opset() >= 18) return counted_parts(builder, size);
  builder.require(builder.input_count() == 1, "expected sizes as an attribute up to operator set 12");
  if (const auto sizes = builder.integers("split"); sizes && builder.opset() < 13) return *sizes;
  const int parts = builder.output_count();
  builder.require(size % parts == 0, fmt::format("{} numbers are not {} equal parts", size, parts));
  return std::vector<std::int64_t>(parts, size / parts);
}

void split(OnnxBuilder& builder) {
  const OnnxValue& source = builder.input(0);
  const int axis = builder.axis(builder.integer("axis", 0), source.rank());
  const std::vector<std::int64_t> sizes = part_sizes(builder, source.shape[axis]);
  builder.require(static_cast<int>(sizes.size()) == builder.output_count(), "expected one size for each output");
  std::int64_t sum = 0;
  for (const std::int64_t size : sizes) {
    builder.require(size >= 0 && size <= source.shape[axis], fmt::format("expected sizes from 0, found {}", size));
    sum += size;
  }
  builder.require(sum == source.shape[axis],
                  fmt::format("expected sizes of sum {}, found {}", source.shape[axis], sum));
  check_moved(builder, source.shape);
  const Places whole = identity_places(source.shape);
  std::int64_t begin = 0;
  for (std::size_t i = 0; i < sizes.size(); begin += sizes[i], ++i) {
    Places places = whole;
    places[axis] = {whole[axis].begin() + begin, whole[axis].begin() + begin + sizes[i]};
    Shape shape = source.shape;
    shape[axis] = sizes[i];
    move(builder, static_cast<int>(i), source, shape, places);
  }
}

void expand(OnnxBuilder& builder) {
  const OnnxValue& source = builder.input(0);
  for (const std::int64_t size : builder.whole_numbers(1))
    builder.require(size >= 0 && size <= kMostOrdered, fmt::format("expected sizes from 0, found {}", size));
  const Shape shape = broadcast_shape(builder, source.shape, builder.whole_numbers(1));
  builder.require(count_of(shape) <= kMostOrdered, fmt::format("gives too many numbers: {}", shape_text(shape)));
  const Shape strides = broadcast_strides(source.shape, shape);
  Places places(shape.size());
  for (std::size_t d = 0; d < shape.size(); ++d)
    for (std::int64_t k = 0; k < shape[d]; ++k) places[d].push_back(k * strides[d]);
  move(builder, 0, source, shape, places);
}

// Rows picked by numbers that depend on the network's input. One that is out of range gives NaN: no step throws.
void gather_at_run_time(OnnxBuilder& builder, int axis, const Shape& shape) {
  const OnnxValue &source = builder.input(0), &indices = builder.input(1);
  const std::int64_t size = source.shape[axis], picked = indices.count();
  const std::int64_t block = count_of(Shape(source.shape.begin() + axis + 1, source.shape.end()));
  const std::int64_t outer = count_of(Shape(source.shape.begin(), source.shape.begin() + axis));
  const float *from = builder.data(source), *index = builder.data(indices);
  float* to = builder.output(0, shape, source.type);
  builder.step([=] {
    for (std::int64_t o = 0; o < outer; ++o)
      for (std::int64_t k = 0; k < picked; ++k) {
        const float at = index[k] < 0 ? index[k] + static_cast<float>(size) : index[k];
        float* row = to + (o * picked + k) * block;
        if (at >= 0 && at < static_cast<float>(size))
          std::copy_n(from + (o * size + static_cast<std::int64_t>(at)) * block, block, row);
        else
          std::fill_n(row, block, std::numeric_limits<float>::quiet_NaN());
      }
  });
}

void gather(OnnxBuilder& builder) {
  const OnnxValue &source = builder.input(0), &indices = builder.input(1);
  const int axis = builder.axis(builder.integer("axis", 0), source.rank());
  builder.require(indices.type == ElementType::kInteger, "input 1: expected whole numbers, found others");
  Shape shape(source.shape.begin(), source.shape.begin() + axis);
  shape.insert(shape.end(), indices.shape.begin(), indices.shape.end());
  shape.insert(shape.end(), source.shape.begin() + axis + 1, source.shape.end());
  if (!indices.constant) return gather_at_run_time(builder, axis, shape);
  check_moved(builder, source.shape);
  Places places = identity_places(source.shape);
  std::vector<std::int64_t> picked;
  for (const std::int64_t index : indices.integers) {
    const std::int64_t size = source.shape[axis];
    builder.require(index >= -size && index < size, fmt::format("expected an index below {}, found {}", size, index));
    picked.push_back(places[axis][index < 0 ? index + size : index]);
  }
  places[axis] = picked;
  move(builder, 0, source, shape, places);
}

struct Part {
  const float* from;
  std::int64_t count;  // in one turn
};

void concat_floats(OnnxBuilder& builder, const Shape& shape, int axis) {
  std::vector<Part> parts;
  for (int i = 0; i < builder.input_count(); ++i) {
    const Shape& part = builder.input(i).shape;
    parts.push_back({builder.data(builder.input(i)), count_of(Shape(part.begin() + axis, part.end()))});
  }
  const std::int64_t outer = count_of(Shape(shape.begin(), shape.begin() + axis));
  float* to = builder.output(0, shape, builder.input(0).type);
  builder.step([parts, outer, to] {
    float* at = to;
    for (std::int64_t o = 0; o < outer; ++o)
      for (const Part& part : parts) at = std::copy_n(part.from + o * part.count, part.count, at);
  });
}

void concat(OnnxBuilder& builder) {
  Shape shape = builder.input(0).shape;
  builder.require(builder.attribute("axis") != nullptr, "expected an attribute 'axis', found none");
  const int axis = builder.axis(builder.integer("axis", 0), builder.input(0).rank());
  shape[axis] = 0;
  bool whole = true;
  std::vector<std::int64_t> joined;
  for (int i = 0; i < builder.input_count(); ++i) {
    builder.require(builder.has_input(i), fmt::format("expected an input {}, found none", i));
    const OnnxValue& part = builder.input(i);
    Shape expected = shape;
    if (part.rank() > axis) expected[axis] = part.shape[axis];
    builder.require(
        part.type == builder.input(0).type && part.shape == expected,
        fmt::format("input {}: expected shape {}, found {}", i, shape_text(expected), shape_text(part.shape)));
    shape[axis] += part.shape[axis];
    whole = whole && part.whole_constant() && part.rank() == 1;
    joined.insert(joined.end(), part.integers.begin(), part.integers.end());
  }
  if (whole) return builder.whole_output(0, shape, joined, builder.input(0).type);
  concat_floats(builder, shape, axis);
}

constexpr int kAny = std::numeric_limits<int>::max();
constexpr OnnxOperator kMovementOperators[] = {
    {"Concat", 1, kAny, 1, concat}, {"Expand", 2, 2, 1, expand},  {"Gather", 2, 2, 1, gather},
    {"Slice", 3, 5, 1, slice},      {"Split", 1, 2, kAny, split}, {"Transpose", 1, 1, 1, transpose},
};

}  // namespace

std::span<const OnnxOperator> movement_operators() { return kMovementOperators; }

}  // namespace duet
