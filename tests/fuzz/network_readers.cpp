// Networks: ONNX, safetensors, TorchScript. A network that was read is evaluated once where it is small. The ONNX
// sample's nodes are chosen by the seed, so that mutations meet every operator.
#include <onnx/onnx_pb.h>

#include <vector>

#include "duet/archives/zip/zip.h"
#include "duet/nn/mlp.h"
#include "duet/nn/onnx/onnx_plan.h"
#include "duet/nn/torch/torch_script.h"
#include "tests/fuzz/reader.h"
#include "tests/fuzz/tensor_edit.h"

namespace duet::fuzz {
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

std::string onnx_sample(unsigned seed) {
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

void run_once(Network& network) {
  constexpr int kSmall = 1 << 16;
  std::vector<std::vector<float>> in, out;
  for (const Port& port : network.inputs()) {
    if (port.size > kSmall) return;
    in.emplace_back(port.size, 0.5F);
  }
  for (const Port& port : network.outputs()) {
    if (port.size > kSmall) return;
    out.emplace_back(port.size);
  }
  const std::vector<std::span<const float>> inputs(in.begin(), in.end());
  const std::vector<std::span<float>> outputs(out.begin(), out.end());
  network.run(inputs, outputs);
}

void read_onnx(std::string_view bytes) { run_once(*onnx_network(bytes, "fuzz.onnx")); }

SafeTensors good_tensors() {
  SafeTensors content;
  content.metadata = {{"kind", "sample"}};
  content.tensors["a.0.weight"] = {{2, 3}, {1, 2, 3, 4, 5, 6}};
  content.tensors["a.0.bias"] = {{2}, {0.5F, -0.5F}};
  return content;
}

std::string safetensors_sample(unsigned /*seed*/) { return safetensors_bytes(good_tensors()); }

void read_safetensors_file(std::string_view bytes) {
  const SafeTensors content = parse_safetensors(tensors_of(good_tensors(), bytes), "fuzz");
  (void)safetensors_bytes(content);  // what was read can be written
  (void)read_mlp(content, "a", "fuzz");
}

// As PyTorch writes it: 5 inputs, 4 hidden, 3 and 2 outputs. The parts of the archive's text are what is mutated, as
// its checksums guard the archive.
const std::string kTorchCode =
    "class PolicyExporterLSTM(Module):\n\n  __annotations__[\"0\"] = __torch__.torch.nn.modules.linear.Linear\n"
    "  __annotations__[\"1\"] = __torch__.torch.nn.modules.activation.ELU\n"
    "  __annotations__[\"2\"] = __torch__.torch.nn.modules.linear.___torch_mangle_0.Linear\n\n"
    "  alpha : Final[float] = 1.\n\n"
    "  num_layers : Final[int] = 1\n  proj_size : Final[int] = 0\n  bidirectional : Final[bool] = False\n";

// `counts`: numbers of each tensor, one byte each.
std::string torch_archive(std::string_view code, std::string_view counts) {
  std::vector<ZipEntry> entries = {{"policy/data.pkl", "ctorch\nFloatStorage\n"},
                                   {"policy/byteorder", "little"},
                                   {"policy/code/all.py", std::string(code)}};
  for (std::size_t k = 0; k < counts.size() && k < 40; ++k)
    entries.push_back(
        {"policy/data/" + std::to_string(k), std::string(sizeof(float) * static_cast<unsigned char>(counts[k]), '\0')});
  return zip_bytes(entries);
}

const std::string kTorchCounts = {4, 4, 12, 3, 6, 2, 80, 64, 16, 16};

std::string torch_sample(unsigned seed) {
  const std::string text = kTorchCode + std::string(kSeparator) + kTorchCounts;
  return seed % 2 == 0 ? torch_archive(kTorchCode, kTorchCounts) : std::string(kEdit) + text;
}

void read_torch_script(std::string_view bytes) {
  if (!bytes.starts_with(kEdit)) return run_once(*torch_script_network(bytes, "fuzz.pt"));
  const std::vector<std::string_view> texts = parts(bytes.substr(kEdit.size()), 2);
  run_once(*torch_script_network(torch_archive(texts[0], texts[1]), "fuzz.pt"));
}

}  // namespace

std::vector<Reader> network_readers() {
  return {{"onnx", onnx_sample, read_onnx},
          {"safetensors", safetensors_sample, read_safetensors_file},
          {"torch_script", torch_sample, read_torch_script}};
}

}  // namespace duet::fuzz
