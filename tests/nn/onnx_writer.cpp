#include "tests/nn/onnx_writer.h"

#include <gtest/gtest.h>
#include <onnx/onnx_pb.h>

#include <algorithm>
#include <cmath>

#include "duet/core/require.h"
#include "duet/nn/onnx/onnx_plan.h"
#include "tests/nn/evaluate.h"
#include "tests/support.h"

namespace duet::test {
namespace {

void fill(onnx::TensorProto& to, const OnnxTensor& from) {
  for (const std::int64_t size : from.shape) to.add_dims(size);
  if (from.type == ElementType::kFloat) {
    to.set_data_type(onnx::TensorProto::FLOAT);
    to.set_raw_data(from.floats.data(), from.floats.size() * sizeof(float));
  } else if (from.type == ElementType::kInteger) {
    to.set_data_type(onnx::TensorProto::INT64);
    to.set_raw_data(from.integers.data(), from.integers.size() * sizeof(std::int64_t));
  } else {
    to.set_data_type(onnx::TensorProto::BOOL);
    for (const std::int64_t value : from.integers) to.add_int32_data(static_cast<int>(value));
  }
}

struct SetAttribute {
  onnx::AttributeProto& to;
  void operator()(std::int64_t value) const { to.set_type(onnx::AttributeProto::INT), to.set_i(value); }
  void operator()(float value) const { to.set_type(onnx::AttributeProto::FLOAT), to.set_f(value); }
  void operator()(const std::string& value) const { to.set_type(onnx::AttributeProto::STRING), to.set_s(value); }
  void operator()(const std::vector<std::int64_t>& values) const {
    to.set_type(onnx::AttributeProto::INTS);
    for (const std::int64_t value : values) to.add_ints(value);
  }
  void operator()(const std::vector<float>& values) const {
    to.set_type(onnx::AttributeProto::FLOATS);
    for (const float value : values) to.add_floats(value);
  }
  void operator()(const std::vector<std::string>& values) const {
    to.set_type(onnx::AttributeProto::STRINGS);
    for (const std::string& value : values) to.add_strings(value);
  }
  void operator()(const OnnxTensor& value) const {
    to.set_type(onnx::AttributeProto::TENSOR), fill(*to.mutable_t(), value);
  }
};

void describe(onnx::ValueInfoProto& info, const std::string& name, const Shape& shape) {
  info.set_name(name);
  auto* type = info.mutable_type()->mutable_tensor_type();
  type->set_elem_type(onnx::TensorProto::FLOAT);
  for (const std::int64_t size : shape) {
    auto* dim = type->mutable_shape()->add_dim();
    if (size < 0)
      dim->set_dim_param("batch");
    else
      dim->set_dim_value(size);
  }
}

}  // namespace

OnnxWriter::OnnxWriter(int opset) : model_(std::make_unique<onnx::ModelProto>()) {
  model_->set_ir_version(7);
  model_->add_opset_import()->set_version(opset);
  model_->mutable_graph()->set_name("test");
}

OnnxWriter::~OnnxWriter() = default;

OnnxWriter& OnnxWriter::input(const std::string& name, const Shape& shape) {
  describe(*model_->mutable_graph()->add_input(), name, shape);
  return *this;
}

OnnxWriter& OnnxWriter::output(const std::string& name) { return output(name, {}); }

OnnxWriter& OnnxWriter::output(const std::string& name, const Shape& shape) {
  describe(*model_->mutable_graph()->add_output(), name, shape);
  return *this;
}

OnnxWriter& OnnxWriter::constant(const std::string& name, const Shape& shape, const std::vector<float>& values) {
  return tensor(name, {.type = ElementType::kFloat, .shape = shape, .floats = values, .integers = {}});
}

OnnxWriter& OnnxWriter::whole(const std::string& name, const std::vector<std::int64_t>& values) {
  return tensor(name, {.type = ElementType::kInteger,
                       .shape = {static_cast<std::int64_t>(values.size())},
                       .floats = {},
                       .integers = values});
}

OnnxWriter& OnnxWriter::tensor(const std::string& name, const OnnxTensor& tensor) {
  auto* constant = model_->mutable_graph()->add_initializer();
  fill(*constant, tensor);
  constant->set_name(name);
  return *this;
}

OnnxWriter& OnnxWriter::node(const std::string& op, const std::vector<std::string>& inputs,
                             const std::vector<std::string>& outputs, const Attributes& attributes,
                             const std::string& domain) {
  auto* node = model_->mutable_graph()->add_node();
  node->set_op_type(op);
  if (!domain.empty()) node->set_domain(domain);
  for (const std::string& name : inputs) node->add_input(name);
  for (const std::string& name : outputs) node->add_output(name);
  for (const auto& [name, value] : attributes) {
    auto* attribute = node->add_attribute();
    attribute->set_name(name);
    std::visit(SetAttribute{*attribute}, value);
  }
  return *this;
}

std::string OnnxWriter::bytes() const { return model_->SerializeAsString(); }

std::unique_ptr<Network> OnnxWriter::network() const { return onnx_network(bytes(), "test.onnx"); }

std::string OnnxWriter::refusal() const {
  return thrown_message<InputError>([&] { (void)network(); });
}

Operand operand(const Shape& shape, int seed, double scale) {
  Operand operand{shape, {}};
  std::int64_t count = 1;
  for (const std::int64_t size : shape) count *= size;
  for (std::int64_t k = 0; k < count; ++k)
    operand.values.push_back(static_cast<float>(scale * std::sin(0.7 * static_cast<double>(k) + 0.1 + 1.3 * seed)));
  return operand;
}

std::vector<float> through(const std::string& op, const std::vector<Operand>& operands, const Attributes& attributes,
                           int opset, unsigned constants) {
  OnnxWriter writer(opset);
  std::vector<std::string> names;
  std::vector<std::vector<float>> inputs;
  for (std::size_t k = 0; k < operands.size(); ++k) {
    names.push_back("in" + std::to_string(k));
    if ((constants >> k & 1U) != 0) {
      writer.constant(names.back(), operands[k].shape, operands[k].values);
    } else {
      writer.input(names.back(), operands[k].shape);
      inputs.push_back(operands[k].values);
    }
  }
  const auto network = writer.node(op, names, {"y"}, attributes).output("y").network();
  return evaluate(*network, inputs)[0];
}

void expect_node(const std::string& op, const std::vector<Operand>& operands, const std::vector<double>& expected,
                 const Attributes& attributes, const std::vector<int>& opsets) {
  for (const int opset : opsets)
    for (unsigned constants = 0; constants < 1U << operands.size(); ++constants) {
      const std::vector<float> found = through(op, operands, attributes, opset, constants);
      ASSERT_EQ(found.size(), expected.size()) << op;
      for (std::size_t k = 0; k < found.size(); ++k)
        ASSERT_NEAR(found[k], expected[k], 1e-6 * std::max(1.0, std::abs(expected[k])))
            << op << " in operator set " << opset << ", constants " << constants << ", at " << k;
    }
}

}  // namespace duet::test
