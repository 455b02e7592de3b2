// ONNX models: read, planned, and evaluated once where they are small. The sample's nodes are chosen by the seed, so
// that mutations meet every operator.
#include <onnx/onnx_pb.h>

#include <vector>

#include "nn/onnx_network.h"
#include "tests/fuzz/reader.h"

namespace {

void add_port(onnx::ValueInfoProto& port, const std::string& name) {
  port.set_name(name);
  port.mutable_type()->mutable_tensor_type()->set_elem_type(onnx::TensorProto::FLOAT);
}

void add_dims(onnx::ValueInfoProto& port) {
  for (const int size : {1, 2, 3})
    port.mutable_type()->mutable_tensor_type()->mutable_shape()->add_dim()->set_dim_value(size);
}

void add_floats(onnx::GraphProto& graph, const std::string& name, const std::vector<std::int64_t>& shape) {
  auto& tensor = *graph.add_initializer();
  tensor.set_name(name);
  tensor.set_data_type(onnx::TensorProto::FLOAT);
  std::int64_t count = 1;
  for (const std::int64_t size : shape) {
    tensor.add_dims(size);
    count *= size;
  }
  for (std::int64_t k = 0; k < count; ++k) tensor.add_float_data(0.25F * static_cast<float>(k % 7));
}

void add_whole(onnx::GraphProto& graph, const std::string& name, const std::vector<std::int64_t>& values) {
  auto& tensor = *graph.add_initializer();
  tensor.set_name(name);
  tensor.set_data_type(onnx::TensorProto::INT64);
  tensor.add_dims(static_cast<std::int64_t>(values.size()));
  for (const std::int64_t value : values) tensor.add_int64_data(value);
}

struct Sample {
  const char* op;
  std::vector<std::string> inputs;
  const char* attribute = "";  // one of whole numbers, with one value
  std::int64_t value = 0;
};

const std::vector<Sample>& samples() {
  static const std::vector<Sample> list = {
      {"MatMul", {"x", "W"}},
      {"Conv", {"x", "k"}},
      {"Add", {"x", "b"}},
      {"Div", {"x", "b"}},
      {"Pow", {"x", "b"}},
      {"Slice", {"x", "one", "three"}},
      {"Reshape", {"x", "three"}},
      {"Expand", {"x", "three"}},
      {"Gather", {"x", "one"}},
      {"Squeeze", {"x", "zero"}},
      {"Split", {"x"}, "axis", 2},
      {"Concat", {"x", "x"}, "axis", 1},
      {"Unsqueeze", {"x", "zero"}},
      {"Transpose", {"x"}},
      {"ReduceSum", {"x", "one"}},
      {"ReduceMean", {"x"}},
      {"Softmax", {"x"}},
      {"LayerNormalization", {"x", "b"}},
      {"Flatten", {"x"}, "axis", 1},
      {"Cast", {"x"}, "to", 7},
      {"Clip", {"x", "s", "s"}},
      {"LSTM", {"x", "LW", "LR"}},
      {"GRU", {"x", "GW", "GR"}},
      {"Where", {"x", "x", "x"}},
      {"Shape", {"x"}},
      {"Elu", {"x"}},
      {"ConstantOfShape", {"three"}},
  };
  return list;
}

std::string sample(unsigned seed) {
  onnx::ModelProto model;
  model.add_opset_import()->set_version(11 + seed / 64 % 7);
  onnx::GraphProto& graph = *model.mutable_graph();
  add_port(*graph.add_input(), "x");
  add_dims(*graph.mutable_input(0));
  add_floats(graph, "W", {3, 4});
  add_floats(graph, "k", {2, 2, 2});
  add_floats(graph, "b", {3});
  add_floats(graph, "s", {});
  add_floats(graph, "LW", {1, 8, 3});
  add_floats(graph, "LR", {1, 8, 2});
  add_floats(graph, "GW", {1, 6, 3});
  add_floats(graph, "GR", {1, 6, 2});
  add_whole(graph, "zero", {0});
  add_whole(graph, "one", {1});
  add_whole(graph, "three", {3});
  const Sample& chosen = samples()[seed / 448 % samples().size()];
  auto& node = *graph.add_node();
  node.set_op_type(chosen.op);
  for (const std::string& input : chosen.inputs) node.add_input(input);
  node.add_output("y");
  if (*chosen.attribute != '\0') {
    auto& attribute = *node.add_attribute();
    attribute.set_name(chosen.attribute);
    attribute.set_type(onnx::AttributeProto::INT);
    attribute.set_i(chosen.value);
  }
  add_port(*graph.add_output(), "y");
  return model.SerializeAsString();
}

void run_once(duet::Network& network) {
  constexpr int kSmall = 1 << 16;
  std::vector<std::vector<float>> in, out;
  for (const duet::Port& port : network.inputs()) {
    if (port.size > kSmall) return;
    in.emplace_back(port.size, 0.5F);
  }
  for (const duet::Port& port : network.outputs()) {
    if (port.size > kSmall) return;
    out.emplace_back(port.size);
  }
  const std::vector<std::span<const float>> inputs(in.begin(), in.end());
  const std::vector<std::span<float>> outputs(out.begin(), out.end());
  network.run(inputs, outputs);
}

}  // namespace

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t max_size,
                                               unsigned seed) {
  return duet::fuzz::mutate(data, size, max_size, seed, sample(seed));
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return duet::fuzz::read_or_refuse(
      [&] { run_once(*duet::onnx_network(duet::fuzz::text_of(data, size), "fuzz.onnx")); });
}
